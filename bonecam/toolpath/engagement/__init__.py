"""What stands on a level before it is cut, and which stretches of its passes cut it."""
