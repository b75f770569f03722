"""What an edit did to a terrain: elements, surfaces, ground and verdicts, old against new."""
