"""Scenes: a simulator, its characters' controllers and their parameters, as a file has them."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from msgs_config import files
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.shared_parameters import CharacterSource, SharedSettings

SIMULATOR, CONTROLLER, VIEWER = "sim_node", "controller_node", "viewer"
SEARCH = "motion_reconstruct"  # no node: a command, which has its parameters in the same way
_FOLDER = Path(__file__).parent / "data"
_SUFFIX = ".yaml"
_PARAMETERS = "ros__parameters"
_ANY_NAMESPACE = "/**"
_OPPONENT = "opponent"
Parameters = dict[str, object]

_DEFAULTS: Parameters = {
    "rate": 240,  # Hz
    "real_time_factor": 1.0,
    "wrench_duration": 0.05,  # s; short, so that a drag follows the pointer
    "ball_lifetime": 20.0,  # s
}
_DEFAULTS_OF_SEARCH: Parameters = {"rate": 240}  # Hz; it takes as long as it takes
_OF_CHARACTER = tuple(each.name for each in CharacterSource.declared())
_OF_BOTH = tuple(each.name for each in SharedSettings.declared())


@dataclass(frozen=True)
class Scene:
    """A world to run: the parameters of its nodes."""

    name: str
    title: str  # what there is to see, in one line
    nodes: Mapping[str, Parameters]  # the simulator's first, by names below its namespace
    viewer: Mapping[str, object] = field(default_factory=dict)  # parameters of the page
    search: Mapping[str, object] = field(default_factory=dict)
    """Parameters of the search for a motion that it shows; of a world that runs there are none."""

    @property
    def simulator(self) -> Parameters:
        """The simulator's parameters."""
        return self.nodes[SIMULATOR]

    @property
    def characters(self) -> list[str]:
        """The names of its characters; none of a single one."""
        return _names_in(self.simulator)


def scene_names() -> list[str]:
    """The names of the scenes that come with the package."""
    return sorted(path.stem for path in _FOLDER.glob(f"*{_SUFFIX}"))


def load_scene(name: str, settings: Mapping[str, Parameters] | None = None) -> Scene:
    """A scene that comes with the package, or that of a parameter file.

    Args:
        name: The scene's name, or the path of a .yaml file of parameters by the nodes' names. What
            both sides must agree on needs to be said of the simulator alone.
        settings: Parameters in place of the file's: those of `sim_node`, and those of
            `controller_node`, which count for every controller.

    Raises:
        ConfigurationError: there is no such scene, or the file is malformed.
    """
    path = Path(name) if name.endswith(_SUFFIX) else _FOLDER / f"{name}{_SUFFIX}"
    if path.parent == _FOLDER and not path.is_file():
        refuse_other_kind(Path(name), f"a scene ({_SUFFIX})", (), ConfigurationError)
        raise ConfigurationError(one_of("scene", name, scene_names()))
    refuse_other_kind(path, "a scene", (_SUFFIX,), ConfigurationError)
    text = files.read_text(path, ConfigurationError)
    content = files.parse_yaml_mapping(path, text, ConfigurationError)
    for key, section in content.items():
        if not (isinstance(section, dict) and isinstance(section.get(_PARAMETERS), dict)):
            raise ConfigurationError(f"{path}: '{key}' must hold a mapping '{_PARAMETERS}'")
    settings = settings or {}
    given = _beside(path, _parameters_of(SIMULATOR, content)) | settings.get(SIMULATOR, {})
    if not given:
        raise ConfigurationError(f"{path}: there are no parameters of '{SIMULATOR}'")
    search = _beside(path, _parameters_of(SEARCH, content))
    simulator = (_DEFAULTS_OF_SEARCH if search else _DEFAULTS) | given
    nodes, names = {SIMULATOR: simulator}, _names_in(simulator)
    for character in names or [""]:
        node = f"{character}/{CONTROLLER}".lstrip("/")
        given = _agreed(simulator, character) | _beside(path, _parameters_of(node, content))
        nodes[node] = given = given | settings.get(CONTROLLER, {})
        opponent = given.get(_OPPONENT, "")
        if opponent not in ("", *(name for name in names if name != character)):
            raise ConfigurationError(
                f"{path}: '{_OPPONENT}' of '{node}' is {opponent}, which is no other character"
            )
    viewer = _beside(path, _parameters_of(VIEWER, content))
    return Scene(path.stem, _title(text), nodes, viewer, search)


def _agreed(simulator: Parameters, character: str) -> Parameters:
    """What a character's controller must agree on with the simulator, as far as that is told it."""
    own = {name: simulator[name] for name in (*_OF_CHARACTER, *_OF_BOTH) if name in simulator}
    below = f"{character}." if character else ""
    return own | {
        name: simulator[below + name] for name in _OF_CHARACTER if below + name in simulator
    }


def _beside(scene: Path, given: Parameters) -> Parameters:
    """The parameters, with names of files that lie beside the scene's as whole paths.

    A name without a suffix is none of a file: a clip is called `walk`, too.
    """
    return {
        name: str(scene.parent.absolute() / value)
        if isinstance(value, str) and Path(value).suffix and (scene.parent / value).is_file()
        else value
        for name, value in given.items()
    }


def _title(text: str) -> str:
    """The comment that a file begins with: its first line."""
    first = text.partition("\n")[0]
    return first.removeprefix("#").strip() if first.startswith("#") else ""


def _names_in(simulator: Parameters) -> list[str]:
    names = simulator.get("characters") or []
    return [str(name) for name in names] if isinstance(names, list) else []


def _parameters_of(node: str, content: Mapping[str, Mapping[str, object]]) -> Parameters:
    """What a file says for a node, as rcl reads it: of the keys that match the last one counts."""
    found: Parameters = {}
    for key, section in content.items():
        pattern = re.escape(key).replace(re.escape(_ANY_NAMESPACE), r"(/\w+)*")
        if re.fullmatch(pattern, f"/{node}"):
            found |= _flattened(section[_PARAMETERS])
    return found


def _flattened(section: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    assert isinstance(section, Mapping)
    for name, value in section.items():
        if isinstance(value, dict):
            yield from _flattened(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
