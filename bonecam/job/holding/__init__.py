"""The section [holding] of a job: what holds the part at its lower end, and at its free one."""
