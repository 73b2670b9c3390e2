"""The links and joints of a URDF as rigid bodies: frames, masses and moments of inertia."""
