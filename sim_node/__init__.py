"""The world: forward dynamics `(q, v, effort) -> next state`, and the node around it."""
