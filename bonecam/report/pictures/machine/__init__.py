"""Pictures of a machine: its bodies round the part, and what its file says."""
