"""Iso-height milling: slices of one height, from both sides of the part (compared with morphing by Gan et al. 2014)."""
