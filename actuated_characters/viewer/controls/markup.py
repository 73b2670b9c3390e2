"""Text in the panel, whose language is Markdown."""

_MAX_CHARACTERS = 300  # characters of a sentence
_MARKUP = str.maketrans({mark: f"\\{mark}" for mark in "\\`*_{}[]<>#|~$&"})


def as_text(sentence: str) -> str:
    """A sentence as Markdown that shows it as it is; of a long one its beginning."""
    return sentence[:_MAX_CHARACTERS].translate(_MARKUP)
