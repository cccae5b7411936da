"""Which rules of floating point numbers the compiled loops may break."""

CONTRACT = {"contract", "nsz"}
"""LLVM's flags: a product and a sum may become one operation, the sign of a zero may be lost. The order of
sums stays, so a run gives the same bits again."""
