"""The file of a sweep: what its runs have in common, and what varies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from actuated_characters.sweep.axes import MAX_ROWS, check_axes, read_axes, read_seed
from actuated_characters.sweep.grid import Axis, Row, count_rows, expand
from msgs_config.errors import ConfigurationError
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.files import parse_yaml_mapping, read_text
from msgs_config.mappings import MappingReader

BAGS = ["none", "failures", "all"]
PARTS = ("run", "set", "values", "random", "seeds")
"""The keys of what varies."""


@dataclass(frozen=True)
class Sweep:
    """What a file says: axes whose choices are the rows, and what is kept of them."""

    axes: tuple[Axis, ...]
    bags: str  # of BAGS
    seed: int  # of random values, and of which rows are verified

    def rows(self) -> list[Row]:
        """All rows, in the order of the table."""
        return list(expand(self.axes))


def read_sweep(path: Path, options: Mapping[str, bool], figures: Sequence[str]) -> Sweep:
    """Read a file.

    Args:
        path: Of the file.
        options: Those of the command `run` that `run:` may have, and whether they may be repeated.
        figures: Columns of the table that no value may be named after.

    Raises:
        ConfigurationError: something in it is wrong; names the place, and what would be right.
    """
    reader = open_file(path, "a sweep", (*PARTS, "bags"))
    return sweep_of(reader, options, figures)


def sweep_of(reader: MappingReader, options: Mapping[str, bool], figures: Sequence[str]) -> Sweep:
    """What a file's content says; see `read_sweep`."""
    reader.check_keys((*PARTS, "bags"))
    bags = reader.choice("bags", BAGS)
    axes = read_axes(reader, options, figures)
    check_axes(reader.place, axes)
    if count_rows(axes) > MAX_ROWS:
        raise ConfigurationError(
            f"{reader.place}: these are {count_rows(axes):,} rows; there may be {MAX_ROWS:,}"
        )
    return Sweep(axes, bags, read_seed(reader))


def open_file(path: Path, what: str, keys: Sequence[str]) -> MappingReader:
    """The content of a YAML file that has these keys at most.

    Raises:
        ConfigurationError: it is no such file; `what` says what it should be.
    """
    refuse_other_kind(path, what, (".yaml", ".yml"), ConfigurationError)
    content = parse_yaml_mapping(path, read_text(path, ConfigurationError), ConfigurationError)
    reader = MappingReader(path, content, ConfigurationError)
    reader.check_keys(keys)
    return reader
