"""The file formats of motions."""
