"""Where the passes of a level lie: their side steps, lines and samples."""
