"""Feeds that the machine can drive, in the steps of a scale, and the time of what is driven."""
