"""Error measures of runs and recordings."""
