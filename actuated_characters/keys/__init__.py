"""Keys from motion: the fewest poses whose smooth path stays within a tolerance of it."""
