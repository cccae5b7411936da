"""Probing and roughness of what a program leaves, from its text: a ball that touches the machined surface, profiles."""
