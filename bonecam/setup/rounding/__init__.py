"""Stocks with edges, rounded: what a morph can follow."""
