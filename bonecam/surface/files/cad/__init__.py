"""T-splines in files of CAD systems: STEP and IGES."""
