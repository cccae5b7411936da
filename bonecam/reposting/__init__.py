"""Paths of others, posted for a machine and control of one's own."""
