"""Parameters that are lists of NAME:NUMBER."""

from collections.abc import Iterator, Sequence

from msgs_config.errors import ConfigurationError, one_of


def named_numbers(
    parameter: str,
    texts: Sequence[str],
    what: str,
    names: Sequence[str],
    bounds: tuple[float, float],
) -> Iterator[tuple[str, float]]:
    """The names and numbers that a parameter lists; `what` is what it names.

    Raises:
        ConfigurationError: a name is not among `names`, or a number not within the bounds.
    """
    least, most = bounds
    for text in texts:
        name, _, number = text.rpartition(":")
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not name or not least <= value <= most:
            raise ConfigurationError(
                f"parameter '{parameter}' has {text!r}; it must be {what.upper()}:NUMBER, the "
                f"number {least:g} to {most:g}"
            )
        if name not in names:
            sentence = one_of(what, name, list(names))
            raise ConfigurationError(f"parameter '{parameter}' has {text!r}: {sentence}")
        yield name, value
