"""Ground as few convex solids and height fields, for simulators that collide only with such."""
