"""Adapters for programs that train robots; `make adapters` runs `with_…` with the programs."""
