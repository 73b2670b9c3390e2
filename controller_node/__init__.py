"""The controller: inverse dynamics `(q, v, target) -> effort`, and the node around it."""
