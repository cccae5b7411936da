"""What is measured and certified between neighbouring levels."""
