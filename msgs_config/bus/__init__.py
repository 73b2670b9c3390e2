"""What a node speaks through: topics, services and parameters, over DDS or within one process."""
