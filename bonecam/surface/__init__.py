"""Stage 2: the T-spline surface: kernel, fit, tessellation, files."""
