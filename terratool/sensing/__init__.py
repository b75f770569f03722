"""What sensors read of a terrain."""
