"""Compiled loops: the only door to numba. Plain arrays in, plain arrays out."""
