"""Jobs as TOML files: their reading and writing, and those that ship."""
