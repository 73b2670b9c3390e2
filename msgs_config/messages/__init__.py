"""What crosses between the nodes: topics, stamps and message encodings."""
