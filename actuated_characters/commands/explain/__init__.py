"""What each entry of a policy's observation is, and where a trainer's own differ."""
