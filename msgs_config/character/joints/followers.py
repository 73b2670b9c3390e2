"""Followers of a character: which joints mimic others, and where they rest."""

from dataclasses import replace

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.file import CharacterFile
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character, Gains, Link, UrdfOptions
from msgs_config.character.urdf.mimic import Mimic, read_mimics
from msgs_config.errors import CharacterError, ConfigurationError


def add_mimics(links: list[Link], loading: UrdfOptions) -> tuple[list[Link], list[str]]:
    """The links with what their joints mimic, and a warning for each leader that does not move.

    Of the followers of a leader that is fixed here, because it moves no mass, the first one leads.
    Followers have no effort limit, because no motor drives them.

    Raises:
        CharacterError: a URDF's `<mimic>` makes no sense; names the file and the joint.
    """
    if not loading.mimics:
        return links, []
    mimics = read_mimics(loading.urdf_path, loading.robot, loading.scale)
    moving = [link.joint.name for link in links if link.joint.type is not JointType.FIXED]
    mimics = {name: mimics[name] for name in moving if name in mimics}
    warnings = []
    for leader in sorted({mimic.leader for mimic in mimics.values()} - set(moving)):
        first = _let_first_lead(mimics, leader)
        warnings.append(f"'{leader}' moves no mass, so that '{first}' leads what mimics it")
    joints = {
        name: replace(link.joint, mimic=mimics[name], effort_limit=np.inf)
        for link in links
        if (name := link.joint.name) in mimics
    }
    return [
        replace(link, joint=joints.get(link.joint.name, link.joint)) for link in links
    ], warnings


def _let_first_lead(mimics: dict[str, Mimic], leader: str) -> str:
    """Let one follower of a leader lead the others; its name."""
    followers = [name for name, mimic in mimics.items() if mimic.leader == leader]
    first = next((name for name in followers if mimics[name].multiplier), followers[0])
    scale, offset = mimics[first].multiplier or 1.0, mimics[first].offset
    for name in followers:
        _, multiplier, own = mimics[name]
        mimics[name] = Mimic(first, multiplier / scale, own - multiplier / scale * offset)
    del mimics[first]
    return first


def check_followers(file: CharacterFile, links: list[Link]) -> None:
    """Raise CharacterError if a file gives a motor, or a place to rest, to a joint that follows."""
    for joint in (link.joint for link in links):
        name = joint.name
        if joint.mimic is None:
            continue
        driven = file.gains.get(name, Gains()) != Gains() or name in file.effort_limits
        place = f"joints.{name}" if driven else f"rest_pose.{name}"
        if driven or name in file.rest_pose:
            raise CharacterError(
                f"{file.path}: {place}: the joint mimics '{joint.mimic.leader}' and has no motor; "
                "leave out its gains, effort limit and rest pose"
            )


def check_undriven(character: Character, effort: FloatArray) -> None:
    """Raise ConfigurationError if an effort (n,) drives a joint that mimics another."""
    followers = character.coupling.followers
    driven = followers[np.flatnonzero(np.asarray(effort)[followers])]
    if len(driven):
        name = character.layout.dof_names[driven[0]]
        raise ConfigurationError(
            f"the effort of '{name}' is {effort[driven[0]]:g}; it mimics "
            f"'{character.leaders[name]}' and has no motor, its effort must be 0"
        )


def couple_rest_pose(character: Character, file: CharacterFile) -> Character:
    """The character resting where leaders and followers are within their limits.

    Raises:
        CharacterError: there is no such place, or the file puts a leader elsewhere.
    """
    coupling, names = character.coupling, character.layout.dof_names
    if not coupling:
        return character
    position = np.array(character.rest_position)
    lower, upper = coupling.leader_bounds(*character.position_bounds())
    warnings = []
    for entry in sorted(set(coupling.leaders.tolist())):
        name, low, high = names[entry], lower[entry], upper[entry]
        rest = min(max(position[entry], low), high)
        if low > high or (name in file.rest_pose and rest != position[entry]):
            where = "nowhere" if low > high else f"from {low:.4g} to {high:.4g}"
            raise CharacterError(
                f"{file.path}: '{name}' is to rest at {position[entry]:.4g}, but what mimics it is "
                f"within its own limits {where}"
            )
        if rest != position[entry]:
            warnings.append(f"'{name}' rests at {rest:.4g}, within the limits of what mimics it")
            position[entry] = rest
    rest_position = tuple(coupling.position(position).tolist())
    return replace(
        character, rest_position=rest_position, warnings=(*character.warnings, *warnings)
    )
