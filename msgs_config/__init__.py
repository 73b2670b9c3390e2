"""The contract between simulator and controller: names, layouts, messages, characters."""
