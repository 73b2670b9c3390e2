"""A character's description: files, links, joints, shapes."""
