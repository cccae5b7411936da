"""Machining: the program of the levels of a part, and once more with feeds by the force that its simulation finds."""
