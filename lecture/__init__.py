"""The lecture's figures, each worked out by runs of the real nodes in lockstep."""
