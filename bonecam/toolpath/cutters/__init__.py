"""Cutters: profiles of revolution with shank, holder and spindle nose."""
