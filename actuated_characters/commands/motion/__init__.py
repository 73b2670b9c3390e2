"""The sub-commands of `actuated_characters motion`."""
