"""Definitions to start from: a kind and its options become the text of a terrain."""
