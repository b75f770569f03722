"""Importing: the kernels in C++. Written by `make stubs`."""
