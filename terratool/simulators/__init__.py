"""What simulators and the training in them take: terrains for them, and terrains made for them."""
