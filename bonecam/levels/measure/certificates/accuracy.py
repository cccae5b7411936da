"""How tight the bounds of the certificates are made, mm."""

ACCURACY = 1e-4
"""A bound is good enough up to so many mm over a distance that is reached at some point."""

SMALLEST = 1e-4
"""Pieces of patches no larger than this (mm) are not halved again."""

ROUNDING = 1e-8
"""Added to every bound (mm) for the rounding of floating point sums."""

MAX_HALVINGS = 20
"""Most passes over the patches in which those that are bounded too loosely are halved both ways."""
