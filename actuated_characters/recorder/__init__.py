"""The node that writes what goes over the topics into a bag, and measures it."""
