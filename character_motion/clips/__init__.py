"""Motion clips as things to edit: with where they come from, contacts and quality."""
