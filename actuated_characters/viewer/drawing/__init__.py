"""What is drawn: characters, balls, and the ground below them."""
