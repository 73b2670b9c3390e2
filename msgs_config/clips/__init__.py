"""The format of motion clips: which motion a file describes, and the file of a motion."""
