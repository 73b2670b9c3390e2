"""Motion of a character as joints and links of other formats have it."""
