"""T-splines made of random numbers, structured in rows or general, and files of them."""
