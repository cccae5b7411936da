"""Questions to a surface: closest points, curvature, measures, validity."""
