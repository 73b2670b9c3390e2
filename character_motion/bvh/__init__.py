"""BVH files: what is in them, read and written."""
