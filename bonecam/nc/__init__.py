"""Stage 6: machines, dialects, writing and reading NC programs."""
