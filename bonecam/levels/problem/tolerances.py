"""How far a finished level may exceed the limits of its cut, mm."""

DEPTH_TOLERANCE = 0.002
"""mm by which a cut may be deeper than its limit: a fifth of the default gouge and chord tolerance, 0.01 mm."""
NESTING_TOLERANCE = 0.001
"""mm by which a level may lie outside the next one."""
STOCK_TOLERANCE = 0.001
"""mm by which a level may leave the stock."""
