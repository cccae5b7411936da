"""A lump with a groove, the contacts on it, and what stands round it."""
