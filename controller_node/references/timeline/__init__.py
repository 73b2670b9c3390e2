"""Motion laid out on a time line: clips and steering, and layers of poses over them."""
