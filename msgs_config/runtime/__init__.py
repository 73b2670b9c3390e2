"""What each node's process does: start, polling, parameters, diagnostics, exit."""
