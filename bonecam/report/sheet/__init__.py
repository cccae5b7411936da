"""The setup sheet: one page to print, with the drawing of the clamping, tools, axes, checks and warnings."""
