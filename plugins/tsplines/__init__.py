"""T-meshes of any kind: their files, local refinement and diagnosis."""
