"""glTF 2.0: scenes that move, for browsers and for tools of animation."""
