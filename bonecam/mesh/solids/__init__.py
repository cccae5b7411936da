"""Meshes as solids: bodies of revolution, unions and differences, and where faces pass through each other."""
