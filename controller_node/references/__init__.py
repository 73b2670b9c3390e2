"""What the character is to do: the desired state as a function of time."""
