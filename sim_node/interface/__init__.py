"""The simulator's Interface: subscribers, publishers, services."""
