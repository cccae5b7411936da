"""Stage 1: triangle meshes: files, units, repair, harmonic rows, distances."""
