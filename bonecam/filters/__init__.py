"""MeshLab-style filters: records, registry, MeshSet and scripts."""
