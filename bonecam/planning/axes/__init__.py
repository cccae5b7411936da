"""A tool axis for every contact: leaning by the lead angle, admissible, away from the singularity."""
