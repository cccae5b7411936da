"""How far levels may leave their limits as they are measured."""

DEPTH_TOLERANCE = 0.002
"""How much deeper than its limit a cut may be, mm."""
NEST_TOLERANCE = 0.001
"""How far a level may fall behind the one before, mm."""
STOCK_TOLERANCE = 0.001
"""How far a level may leave the stock, mm."""
