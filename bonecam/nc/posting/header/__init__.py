"""The header of a program: what to mount, how the control must be set, the air check."""
