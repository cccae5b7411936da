"""Stage 4: scallop-limited contact paths on a level."""
