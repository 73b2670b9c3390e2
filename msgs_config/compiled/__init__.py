"""What both sides of the loop do in each tick, compiled by numba.

Its functions are Python that numba compiles once and keeps on disk. They hold no lock of Python's,
so that threads share the work. Nothing here may depend on the processor: no BLAS, no reordering of
sums (numba's `fastmath` stays off), elementary functions from the C library.
"""
