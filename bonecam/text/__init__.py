"""Reading texts that strangers wrote: bounded in size and depth, checked against a schema, all faults told at once."""
