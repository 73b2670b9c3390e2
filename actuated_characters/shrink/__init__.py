"""From a run that fell: the fewest and smallest inputs with which it still falls."""
