"""One smooth body around a character's own shapes, which bends with its links."""
