"""What those who watch can do: push, throw, and turn knobs."""
