"""T-splines in files: .tspline, STEP, IGES, and what plugins read and write."""
