"""Tables of runs: a file says what varies, each row is a run, and exact wherever it is computed."""
