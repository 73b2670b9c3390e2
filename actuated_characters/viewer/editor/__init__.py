"""The page on which a timeline is made: a character is posed by hand, key by key."""
