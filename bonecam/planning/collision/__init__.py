"""Proofs that the whole tool is free of collision with level, material, post and table."""
