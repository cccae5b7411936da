"""The filters that come with bonecam, one module a family, found through entry points."""
