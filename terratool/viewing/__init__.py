"""Viewing: pictures of terrains, a page to turn a terrain about, and reports on edits."""
