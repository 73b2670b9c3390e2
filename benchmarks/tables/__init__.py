"""Many runs, and a table of what became of them: `python -m benchmarks.tables`."""
