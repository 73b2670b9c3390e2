"""Trials of controllers: anybody's process put through a named set of runs over topics."""
