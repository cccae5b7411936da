"""Hollows that a ball cannot reach: where it comes to lie in them, and their fill."""
