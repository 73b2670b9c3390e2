"""What needs both sides: runs of simulator and controller, recordings, measurements."""
