"""The post that holds the part: how long it has to be, what would shorten it, and the groove that parts it."""
