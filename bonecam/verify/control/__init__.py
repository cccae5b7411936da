"""What a control would refuse to run, or would run otherwise than the job means: judged on the text as it was read."""
