"""Rows of points round a bone: isolines of a harmonic field."""
