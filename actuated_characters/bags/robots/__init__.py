"""Bags of any robot, of which a character file or the bag itself says what it is."""
