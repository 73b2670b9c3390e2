"""Athletes by state machine: states that set targets of control, and a few laws of balance."""
