"""Pictures of a study: paths, what is left and deviations along a line, strategies beside one another."""
