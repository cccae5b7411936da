"""The report of a run: its types, and how its sections are made."""
