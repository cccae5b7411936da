"""The schemas of machine and dialect files, told once."""
