"""From the text of a program back to moves."""
