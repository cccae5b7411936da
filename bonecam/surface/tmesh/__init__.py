"""T-meshes: which control points there are and which knots each sees."""
