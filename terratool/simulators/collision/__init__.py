"""Ground as few convex solids and height fields, for simulators that collide with no others."""
