"""The motion of a machine's axes along a path: rotary angles, ramps of the speed."""
