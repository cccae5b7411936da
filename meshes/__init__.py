"""The meshes that ship with bonecam and the recipes that made them."""
