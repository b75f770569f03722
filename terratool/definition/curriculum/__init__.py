"""What the user wrote of a grid of training tiles."""
