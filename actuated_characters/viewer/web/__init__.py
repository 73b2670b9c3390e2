"""The web server, and which requests it takes."""
