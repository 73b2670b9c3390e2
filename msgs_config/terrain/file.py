"""A terrain's file: its YAML as the URDF that both engines load and recordings keep."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from msgs_config import files
from msgs_config.character.model import UrdfOptions
from msgs_config.character.urdf.check import check_urdf
from msgs_config.character.urdf.file_formats.source import read_urdf_text
from msgs_config.errors import CharacterError, one_of
from msgs_config.mappings import MappingReader
from msgs_config.shared_parameters import NO_GROUND, PLANE
from msgs_config.terrain.pieces import Block, placed, random_heights, slope, squares, stairs
from msgs_config.terrain.urdf import write_terrain

TERRAINS_DIRECTORY = Path(__file__).parent / "data"

SUFFIXES = (".yaml", ".yml")
"""Of files that are no URDF."""
_GROUND = [PLANE, NO_GROUND]
_PLACE = ("at", "towards")
_MOST = 1000.0  # m, as far as numbers go
_STEEPEST = 40.0  # degrees
_MOST_BLOCKS = 20_000
_PLANE = (
    '<link name="plane"><collision><geometry><plane normal="0 0 1"/></geometry></collision></link>'
)


def shipped_terrains() -> list[str]:
    """The names of the terrains that come with the package."""
    return sorted(path.stem for path in TERRAINS_DIRECTORY.glob("*.yaml"))


def terrain_path(name_or_path: str, besides: Sequence[str] = _GROUND) -> Path:
    """The file of a shipped terrain, or that of a path.

    Raises:
        CharacterError: there is no such terrain or package; names those that there are, and what
            the parameter may be besides.
    """
    if name_or_path in shipped_terrains():
        return TERRAINS_DIRECTORY / f"{name_or_path}.yaml"
    path = files.resolve(name_or_path, Path.cwd(), CharacterError)
    if not (Path(name_or_path).suffix or "/" in name_or_path or path.is_file()):
        sentence = one_of("terrain", name_or_path, [*besides, *shipped_terrains()])
        raise CharacterError(f"{sentence}; or the path of a .yaml file or URDF")
    return path


def read_terrain(name_or_path: str, besides: Sequence[str] = _GROUND) -> UrdfOptions:
    """The terrain that a parameter `terrain` names; see `terrain_path`.

    Raises:
        CharacterError: its file cannot be used, or there is none.
    """
    file = terrain_path(name_or_path, besides)
    text = (
        terrain_urdf(file, files.read_text(file, CharacterError))
        if file.suffix in SUFFIXES
        else read_urdf_text(file).text
    )
    check_urdf(file, text)
    return UrdfOptions(file, text, fixed_base=True)


def terrain_urdf(path: Path, text: str) -> str:
    """The URDF of a terrain's file.

    Raises:
        CharacterError: something in it is wrong; names the place, and what would be right.
    """
    content = files.parse_yaml_mapping(path, text, CharacterError)
    reader = MappingReader(path, content, CharacterError)
    reader.check_keys(("ground", *_KINDS))
    pieces = {
        each.prefix.rstrip("."): _placed(each, read(each))
        for kind, (keys, read) in _KINDS.items()
        for each in _items(reader, kind, keys)
    }
    count = len([block for blocks in pieces.values() for block in blocks])
    if count > _MOST_BLOCKS:
        raise CharacterError(f"{path}: these are {count:,} boxes; there may be {_MOST_BLOCKS:,}")
    has_plane = reader.choice("ground", _GROUND) == PLANE
    if not has_plane and not count:
        raise CharacterError(f"{path} has neither a ground nor pieces")
    return write_terrain({name: each for name, each in pieces.items() if each}, plane=has_plane)


def _placed(reader: MappingReader, blocks: Sequence[Block]) -> list[Block]:
    """A piece's blocks in the world."""
    return placed(blocks, _place(reader), math.radians(reader.number("towards", 0.0)))


def _items(reader: MappingReader, kind: str, keys: Sequence[str]) -> Iterator[MappingReader]:
    """The pieces of a kind."""
    given = reader.content.get(kind, [])
    if not isinstance(given, list):
        raise reader.wrong(kind, given, "a list of mappings")
    for number, item in enumerate(given, start=1):
        if not isinstance(item, dict):
            raise reader.wrong(f"{kind} {number}", item, "a mapping")
        found = MappingReader(reader.place, item, CharacterError, f"{kind} {number}.")
        found.check_keys((*_PLACE, *keys))
        yield found


def _place(reader: MappingReader) -> tuple[float, ...]:
    """Where a piece begins: x and y, and z if it is not on the ground, m."""
    given = reader.content.get("at")
    count = 2 if isinstance(given, list) and len(given) == 2 else 3
    return (*reader.numbers("at", count, (-_MOST, _MOST)), 0.0)[:3]


def _length(reader: MappingReader, key: str, default: float | None = None) -> float:
    return reader.number(key, default, minimum=1e-3, maximum=_MOST)


def _stairs(reader: MappingReader) -> list[Block]:
    return stairs(
        _count(reader, "steps"),
        _length(reader, "rise"),
        _length(reader, "tread"),
        _length(reader, "width", 2.0),
        reader.number("landing", 1.0, minimum=0.0, maximum=_MOST),
        leads_down=reader.flag("down"),
    )


def _slope(reader: MappingReader) -> list[Block]:
    return slope(
        math.radians(reader.number("angle", minimum=0.1, maximum=_STEEPEST)),
        _length(reader, "length"),
        _length(reader, "width", 2.0),
        reader.number("landing", 1.0, minimum=0.0, maximum=_MOST),
        leads_down=reader.flag("down"),
    )


def _box(reader: MappingReader) -> list[Block]:
    x, y, z = reader.numbers("size", 3, (1e-3, _MOST))
    return [Block((x, y, z), (0.0, 0.0, 0.5 * z))]


def _squares(reader: MappingReader) -> list[Block]:
    edge = _length(reader, "edge")
    if ("heights" in reader.content) == ("random" in reader.content):
        raise CharacterError(
            f"{reader.place}: {reader.prefix}heights or {reader.prefix}random says how high the "
            "squares are: one of them"
        )
    if "random" in reader.content:
        part = reader.part("random")
        part.check_keys(("rows", "columns", "least", "most", "seed"))
        least = part.number("least", 0.0, minimum=0.0, maximum=_MOST)
        most = part.number("most", minimum=least, maximum=_MOST)
        shape = _count(part, "rows"), _count(part, "columns")
        if shape[0] * shape[1] > _MOST_BLOCKS:
            raise part.wrong("columns", shape[1], f"at most {_MOST_BLOCKS // shape[0]}")
        return squares(random_heights(shape, (least, most), _count(part, "seed", 0)), edge)
    rows = reader.content["heights"]
    if not isinstance(rows, list) or not rows:
        raise reader.wrong("heights", rows, "a list of rows of heights in m")
    row_reader = MappingReader(
        reader.place,
        {f"row {number}": row for number, row in enumerate(rows, start=1)},
        CharacterError,
        f"{reader.prefix}heights ",
    )
    width = len(rows[0]) if isinstance(rows[0], list) else 0
    read = [row_reader.numbers(key, max(width, 1), (0.0, _MOST)) for key in row_reader.content]
    return squares(read, edge)


def _mesh(reader: MappingReader) -> list[Block]:
    file = files.resolve(reader.text("file"), Path(str(reader.place)).parent, CharacterError)
    scale = _length(reader, "scale", 1.0)
    return [Block((scale, scale, scale), (0.0, 0.0, 0.0), mesh=str(file.absolute()))]


def _count(reader: MappingReader, key: str, least: int = 1) -> int:
    value = reader.content.get(key, least if least == 0 else None)
    if type(value) is not int or not least <= value <= _MOST_BLOCKS:
        raise reader.wrong(key, value, f"a whole number from {least} to {_MOST_BLOCKS}")
    return value


_KINDS: Mapping[str, tuple[Sequence[str], Callable[[MappingReader], list[Block]]]] = {
    "stairs": (("steps", "rise", "tread", "width", "landing", "down"), _stairs),
    "slopes": (("angle", "length", "width", "landing", "down"), _slope),
    "boxes": (("size",), _box),
    "squares": (("edge", "heights", "random"), _squares),
    "meshes": (("file", "scale"), _mesh),
}
