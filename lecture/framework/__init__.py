"""The frame of all studies: runs, results, figures, and measures that several use."""
