"""Parameters that are lists of NAME:NUMBER."""

from collections.abc import Sequence

from msgs_config.errors import ConfigurationError, one_of


def named_numbers(
    parameter: str,
    texts: Sequence[str],
    what: str,
    names: Sequence[str],
    bounds: tuple[float, float],
) -> dict[str, float]:
    """The numbers that a parameter lists, by what they are of; `what` is what that is.

    Raises:
        ConfigurationError: a name is not among `names` or there twice, or a number is not within
            the bounds.
    """
    (least, most), found = bounds, dict[str, float]()
    for text in texts:
        name, _, number = text.rpartition(":")
        value = _number(number)
        if not name or not least <= value <= most:  # NaN is not within
            raise ConfigurationError(
                f"parameter '{parameter}' has {text!r}; it must be {what.upper()}:NUMBER, the "
                f"number {least:g} to {most:g}"
            )
        if name not in names:
            sentence = one_of(what, name, list(names))
            raise ConfigurationError(f"parameter '{parameter}' has {text!r}: {sentence}")
        if name in found:
            raise ConfigurationError(f"parameter '{parameter}' has {name!r} twice; give it once")
        found[name] = value
    return found


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return float("nan")
