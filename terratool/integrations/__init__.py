"""Adapters for programs that train robots: each module is for one of them."""
