"""Modes of a control that are read apart: what must be stated, spindle and coolant."""
