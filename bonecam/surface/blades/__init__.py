"""Blades of turbomachines: tables of their sections and flow paths, and the solids that are made of these."""
