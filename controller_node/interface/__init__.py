"""The controller's Interface: subscribers and publishers."""
