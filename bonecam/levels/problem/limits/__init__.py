"""Limits of one level's program, a file each."""
