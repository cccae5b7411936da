"""Filter scripts (.mlx): read, checked, and run in a process of their own."""
