"""Between this world, x forward and z up, and that of files of animation, z forward and y up."""

import numpy as np

UPRIGHT_XYZW = np.array([-0.5, -0.5, -0.5, 0.5])
"""Turns (x, y, z) of this world to (y, z, x) of a file: y up, forward is z, as glTF has it."""
