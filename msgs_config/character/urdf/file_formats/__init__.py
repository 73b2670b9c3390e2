"""What kind of file a robot is in, how it is expanded, and the words that it may have."""
