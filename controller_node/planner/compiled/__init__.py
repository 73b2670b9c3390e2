"""What the planner does hundred thousands of times a second, compiled by numba.

Its functions are Python that numba compiles at the first call and keeps on disk. They hold no lock
of Python's, so that threads share the work. Nothing here may depend on the processor: no BLAS, no
reordering of sums (numba's `fastmath` stays off), elementary functions from the C library.
"""
