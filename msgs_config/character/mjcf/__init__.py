"""MJCF, MuJoCo's own format, in and out: a file becomes a URDF and the keys of a character."""
