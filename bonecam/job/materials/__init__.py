"""Cutting data of materials, one TOML file each, and their reading."""
