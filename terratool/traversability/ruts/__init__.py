"""What wheels leave behind."""
