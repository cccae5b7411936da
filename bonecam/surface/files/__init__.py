"""T-splines in files: .tspline, .tsm, .iga, STEP, IGES."""
