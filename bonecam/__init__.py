"""bonecam: from a bone mesh to a verified five-axis NC program."""
