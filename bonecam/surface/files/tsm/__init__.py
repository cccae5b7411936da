"""General T-splines in .tsm files, as Rhino and Fusion write them."""
