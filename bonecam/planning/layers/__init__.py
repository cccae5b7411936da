"""What the two strategies that work in layers share: the tool comes down on the part along fixed lines."""
