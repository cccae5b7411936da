"""What a run writes: program, report, surface, and the folder of --keep."""
