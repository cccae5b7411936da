"""The filters of bonecam, one module a stage, found through entry points."""
