"""What joints obey beside their layout: coupling, bounds, effort limits, gains that are found."""
