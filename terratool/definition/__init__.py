"""What the user wrote: text with positions, the typed model, and the rules it must keep."""
