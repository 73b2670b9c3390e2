"""What a recording shows: facts, pictures, comparisons, tables."""
