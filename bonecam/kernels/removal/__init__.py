"""Compiled loops of the removal simulation: material as intervals on rays, cut by the capsules that balls
sweep."""
