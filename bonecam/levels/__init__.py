"""Stage 3: the morph from the part to the stock."""
