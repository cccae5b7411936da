"""A program in numbered files, which a caller runs one after the other."""
