"""Stage 2: what the part is cut from, how it lies in it, how it is held, and how deep each cut may be."""
