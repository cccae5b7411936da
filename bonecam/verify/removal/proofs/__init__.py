"""The removal of programs for one surface and for a wheel, from the stock that stands before them."""
