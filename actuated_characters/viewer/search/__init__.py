"""The page of a search that tries motions in several worlds: the kept, and the one that stays."""
