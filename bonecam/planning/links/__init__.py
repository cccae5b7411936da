"""Moves between passes: retract, traverse round the stock, approach; or a direct link above the surface."""
