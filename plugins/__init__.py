"""What is offered beside the chain, each part a plugin on public names of `bonecam`, found through entry points."""
