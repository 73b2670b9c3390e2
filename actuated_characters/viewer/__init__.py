"""Shows characters in a browser, live, and passes on what is done to them there."""
