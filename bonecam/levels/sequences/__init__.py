"""Sequences of levels from the part to the last one below the stock."""
