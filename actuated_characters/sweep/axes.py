"""What varies in a file of runs: options, parameters, values for places, draws and seeds."""

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from typing import Any

import yaml

from actuated_characters.sweep.draws import Draw, read_draw
from actuated_characters.sweep.grid import PLACE, Axis, Cell, Choice, cell_text
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.files import MAX_YAML_CHARACTERS, parse_yaml
from msgs_config.mappings import MappingReader
from msgs_config.messages.topics import CONTROLLER_NODE, SIM_NODE

SEEDED = (f"{CONTROLLER_NODE}.plan.seed", f"{SIM_NODE}.sensor_seed")
"""The parameters that a seed sets."""
MAX_ROWS = 1_000_000
OWN_COLUMNS = ("row", "seed", "verdict", "state_hash", "error")
_NODES = [SIM_NODE, CONTROLLER_NODE]
_NAME = re.compile(r"[A-Za-z_]\w*")
_LARGEST_SEED = 2**53


def read_axes(
    reader: MappingReader, options: Mapping[str, bool], figures: Sequence[str]
) -> tuple[Axis, ...]:
    """The axes of the parts `run`, `set`, `values`, `random` and `seeds`, in this order.

    Args:
        reader: Of the file.
        options: Those of the command `run` that `run:` may have, and whether they may be repeated.
        figures: Columns of the table that no value may be named after.

    Raises:
        ConfigurationError: something in a part is wrong.
    """
    taken = {*figures, *options, *OWN_COLUMNS}
    random = reader.part("random")
    return (
        *_option_axes(reader.part("run"), options),
        *_parameter_axes(reader.part("set")),
        *_value_axes(reader.part("values"), taken),
        *_random_axis(random, read_seed(reader), taken),
        *_seed_axis(reader),
    )


def read_seed(reader: MappingReader) -> int:
    """The seed of the random values."""
    return _whole(reader.part("random"), "seed", 0, 0, _LARGEST_SEED)


def _option_axes(reader: MappingReader, options: Mapping[str, bool]) -> Iterator[Axis]:
    """An axis for each option of `run`."""
    seen: set[str] = set()
    for key, value in reader.content.items():
        name = key.replace("_", "-")
        if name not in options:
            sentence = one_of("option of run", key, list(options), reader.prefix)
            raise ConfigurationError(f"{reader.place}: {sentence}")
        if name in seen:
            raise ConfigurationError(f"{reader.place}: {reader.prefix}{name} is given twice")
        seen.add(name)
        repeats = options[name]
        right = "a text, a number" + (", a list of them" if repeats else "") + " or a list of such"
        choices = []
        for item in _items(reader, key, value):
            texts = item if isinstance(item, list) and repeats else [item]
            if not all(_is_text_or_number(each) for each in texts) and item is not None:
                raise reader.wrong(key, item, right)
            words = [] if item is None else [cell_text(each) for each in texts]
            cell = None if item is None else item if len(texts) == 1 else "; ".join(words)
            arguments = tuple(f"--{name}={word}" for word in words)
            choices.append((cell, arguments))
        yield _axis(reader, key, name, choices)


def _parameter_axes(reader: MappingReader) -> Iterator[Axis]:
    """An axis for each parameter."""
    for key, value in reader.content.items():
        check_parameter(reader, key)
        choices = []
        for item in _items(reader, key, value):
            if isinstance(item, dict):
                raise reader.wrong(key, item, "a value of the parameter, or a list of values")
            text = _yaml_text(item)
            arguments = () if item is None else (f"--set={key}:={text}",)
            choices.append((text if isinstance(item, list) else item, arguments))
        yield _axis(reader, key, key, choices)


def _value_axes(reader: MappingReader, taken: Set[str]) -> Iterator[Axis]:
    """An axis for each value that texts have places for."""
    for key, value in reader.content.items():
        check_value_name(reader, key, taken)
        items = _items(reader, key, value)
        if not all(_is_text_or_number(item) for item in items):
            raise reader.wrong(key, value, "a text, a number or a list of such")
        axis = _axis(reader, key, key, [(item, ()) for item in items])
        yield [
            Choice(cells=choice.cells, values={key: item})
            for choice, item in zip(axis, items, strict=True)
        ]


def _random_axis(reader: MappingReader, seed: int, taken: Set[str]) -> Iterator[Axis]:
    """An axis of draws, each of all random values; none without any."""
    names = [name for name in reader.content if name not in ("count", "seed")]
    if not names:
        if "count" in reader.content:
            raise reader.wrong("count", reader.content["count"], "left out: nothing is random")
        return
    count = _whole(reader, "count", None, 1, MAX_ROWS)
    draws: dict[str, Draw] = {}
    for name in names:
        if "." in name:
            check_parameter(reader, name)
        else:
            check_value_name(reader, name, taken)
        draws[name] = read_draw(reader.part(name))
    yield [_drawn(reader, draws, seed, number) for number in range(count)]


def _drawn(reader: MappingReader, draws: Mapping[str, Draw], seed: int, number: int) -> Choice:
    try:
        drawn = {name: draw.value(seed, name, number) for name, draw in draws.items()}
    except ConfigurationError as error:
        raise ConfigurationError(f"{reader.place}: {error}") from error
    parameters = {name: value for name, value in drawn.items() if "." in name}
    return Choice(
        tuple(f"--set={name}:={cell_text(value)}" for name, value in parameters.items()),
        drawn,
        {name: value for name, value in drawn.items() if name not in parameters},
    )


def _seed_axis(reader: MappingReader) -> Iterator[Axis]:
    """An axis of seeds, given as their number or as a list; none without any."""
    given = reader.content.get("seeds")
    if given is None:
        return
    if type(given) is int and 1 <= given <= MAX_ROWS:
        given = list(range(1, given + 1))
    if not isinstance(given, list) or not all(
        type(each) is int and 0 <= each <= _LARGEST_SEED for each in given
    ):
        raise reader.wrong("seeds", given, "their number, or a list of whole numbers")
    choices = [(seed, tuple(f"--set={name}:={seed}" for name in SEEDED)) for seed in given]
    yield _axis(reader, "seeds", "seed", choices, is_list=True)


def _axis(
    reader: MappingReader,
    key: str,
    column: str,
    choices: Sequence[tuple[Cell, tuple[str, ...]]],
    is_list: bool | None = None,
) -> Axis:
    """An axis of entries and arguments; it is a column if it was written as a list."""
    if is_list is None:
        is_list = isinstance(reader.content[key], list)
    texts = [(cell_text(cell), arguments) for cell, arguments in choices]
    for place, text in enumerate(texts):
        if text in texts[:place]:
            raise ConfigurationError(f"{reader.place}: {reader.prefix}{key} has {text[0]} twice")
    return [Choice(arguments, {column: cell} if is_list else {}) for cell, arguments in choices]


def _items(reader: MappingReader, key: str, value: object) -> list[Any]:
    """The entries of a list, or the only one."""
    if value == []:
        raise reader.wrong(key, value, "a value, or a list of at least one")
    return value if isinstance(value, list) else [value]


def check_parameter(reader: MappingReader, key: str) -> None:
    """Raise ConfigurationError if a key is no parameter of a node of a run."""
    node, dot, name = key.partition(".")
    if not (dot and name):
        raise ConfigurationError(
            f"{reader.place}: {reader.prefix}{key} is no parameter; write it as NODE.NAME"
        )
    if node not in _NODES:
        sentence = one_of("node", node, _NODES, reader.prefix)
        raise ConfigurationError(f"{reader.place}: {sentence}")


def check_value_name(reader: MappingReader, key: str, taken: Set[str]) -> None:
    """Raise ConfigurationError if a key cannot be the name of a value for places in texts."""
    if not _NAME.fullmatch(key):
        raise ConfigurationError(
            f"{reader.place}: {reader.prefix}{key} must be a name of letters, digits and _, for "
            "which texts have a place in braces; parameters are NODE.NAME"
        )
    if key in taken:
        raise ConfigurationError(
            f"{reader.place}: {reader.prefix}{key} is the name of another column; choose another"
        )


def check_axes(place: object, axes: Sequence[Axis]) -> None:
    """Check that axes go together.

    Raises:
        ConfigurationError: a place in a text has no value, a value no place, or two axes have the
            same column or set the same parameter; begins with the `place`.
    """
    _check_places(place, axes)
    _check_given_once(place, axes)


def _check_places(path: object, axes: Sequence[Axis]) -> None:
    """Check that each place in a text has a value, and each value a place."""
    choices = [choice for axis in axes for choice in axis]
    values = {name for choice in choices for name in choice.values}
    texts = (text for choice in choices for text in choice.arguments)
    places = {place for text in texts for place in PLACE.findall(text)}
    for name in sorted(places - values):
        sentence = (
            one_of("value", name, sorted(values)) if values else f"there is no value '{name}'"
        )
        raise ConfigurationError(f"{path}: of the place {{{name}}}: {sentence}")
    for name in sorted(values - places):
        raise ConfigurationError(
            f"{path}: nothing uses the value '{name}'; a text in run: or set: must have the place "
            f"{{{name}}}"
        )


def _check_given_once(path: object, axes: Sequence[Axis]) -> None:
    """Check that no two axes have the same column, or set the same parameter."""
    seen: set[str] = set()
    for axis in axes:
        own = {column for choice in axis for column in choice.cells}
        for choice in axis:
            words = (text.partition(":=") for text in choice.arguments)
            own |= {name.removeprefix("--set=") for name, assigns, _ in words if assigns}
        for name in sorted(own & seen):
            also = ", which seeds set" if name in SEEDED else ""
            raise ConfigurationError(f"{path}: {name} is given twice{also}; give it once")
        seen |= own


def _whole(reader: MappingReader, key: str, default: int | None, least: int, largest: int) -> int:
    value = reader.content.get(key, default)
    if type(value) is not int or not least <= value <= largest:
        raise reader.wrong(key, value, f"a whole number from {least} to {largest}")
    return value


def _is_text_or_number(value: object) -> bool:
    return isinstance(value, (str, int, float)) and not isinstance(value, bool)


def _yaml_text(value: Any, in_list: bool = False) -> str:
    """A parameter's value as `--set` takes it: YAML that stands for it; one with places as is."""
    if isinstance(value, list):
        return f"[{', '.join(_yaml_text(each, in_list=True) for each in value)}]"
    if not isinstance(value, str):
        text = "null" if value is None else cell_text(value)
        return {"inf": ".inf", "-inf": "-.inf", "nan": ".nan"}.get(text, text)
    if PLACE.search(value) or (not in_list and _reads_back(value)):
        return value
    quoted: str = yaml.safe_dump(value, default_style='"', width=MAX_YAML_CHARACTERS)
    return quoted.strip()


def _reads_back(text: str) -> bool:
    """Whether a text, read as YAML, is itself."""
    try:
        return bool(parse_yaml("", text, ConfigurationError) == text)
    except ConfigurationError:
        return False
