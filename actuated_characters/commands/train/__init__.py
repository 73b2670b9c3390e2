"""The command `actuated_characters train`."""
