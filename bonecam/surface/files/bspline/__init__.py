"""T-splines as tensor-product B-splines, and back."""
