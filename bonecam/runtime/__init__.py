"""The process that runs: its signals, its temporary files, and how outputs take their place."""
