"""Which bodies of an MJCF file are the character, and what its links and joints are called.

A character is one tree with one base. A file is a world, which may have several robots, furniture
and things that lie about.
"""

from dataclasses import dataclass

import mujoco

from msgs_config.character.layout import ROOT
from msgs_config.character.mjcf.compiling import CompiledMjcf
from msgs_config.character.urdf.file_formats.vocabulary import LeftOut, listed
from msgs_config.errors import CharacterError

WORLD = "world"
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


@dataclass(frozen=True)
class Robot:
    """The bodies of a character by their numbers in MuJoCo, parents first."""

    bodies: tuple[int, ...]
    floats: bool
    """Whether its base floats: the first body. If not, what it hangs on is the world."""
    links: dict[int, str]
    """The name of each body's link; of the world's too, on which a fixed one hangs."""
    joints: dict[int, str]
    """The name of each joint, but of the base's."""
    between: dict[int, str]
    """The name of the link without mass that a joint leads to, where it is not its body's last."""
    remarks: tuple[LeftOut, ...]

    @property
    def numbers(self) -> frozenset[int]:
        """The bodies, for looking them up."""
        return frozenset(self.bodies)


def find_robot(mjcf: CompiledMjcf) -> Robot:
    """The tree that moves in most ways: all that hangs on the world, or one whose base floats.

    Raises:
        CharacterError: nothing moves.
    """
    model = mjcf.model
    trees = [body for body in range(1, model.nbody) if model.body_parentid[body] == 0]
    moving = [tree for tree in trees if any(_joints_of(model, b) for b in _below(model, tree))]
    floating = [tree for tree in moving if _is_free(model, tree)]
    fixed = [tree for tree in moving if tree not in floating]
    candidates = [[tree] for tree in floating] + ([fixed] if fixed else [])
    if not candidates:
        raise CharacterError(f"{mjcf.path}: no body has a joint; a character needs one that moves")
    chosen = max(candidates, key=lambda each: _motions(model, each))
    bodies = tuple(sorted(body for tree in chosen for body in _below(model, tree)))
    floats = chosen != fixed
    left_out = [mjcf.name("body", tree) for tree in trees if tree not in chosen]
    remarks = []
    if left_out:
        line = f"left out: bodies beside the character ({len(left_out)}): {listed(left_out)}"
        remarks.append(LeftOut("body", line))
    return _name(mjcf, bodies, floats, remarks)


def _name(
    mjcf: CompiledMjcf, bodies: tuple[int, ...], floats: bool, remarks: list[LeftOut]
) -> Robot:
    model = mjcf.model
    links = {body: mjcf.name("body", body) for body in bodies}
    if not floats:
        links[0] = WORLD
    used = set(links.values())
    joints: dict[int, str] = {}
    between: dict[int, str] = {}
    renamed = []
    for body in bodies:
        own = own_joints(model, body)
        for place, joint in enumerate(own):
            name = str(model.joint(joint).name)
            number = f"_{place + 1}" if len(own) > 1 else ""
            wanted = name or f"{links[body]}_joint{number}"
            if wanted == ROOT:
                wanted = f"{ROOT}_joint"
                renamed.append(wanted)
            joints[joint] = _unused(wanted, set(joints.values()))
            if joint != own[-1]:
                between[joint] = _unused(f"{links[body]}_{joints[joint]}", used)
                used.add(between[joint])
    if renamed:
        line = f"a joint is named '{ROOT}', which is the floating base's: here '{renamed[0]}'"
        remarks.append(LeftOut("joint", line))
    return Robot(bodies, floats, links, joints, between, tuple(remarks))


def own_joints(model: mujoco.MjModel, body: int) -> list[int]:
    """The joints of a body by their numbers, in the order in which they move it; no free one."""
    return [joint for joint in _joints_of(model, body) if model.jnt_type[joint] != _FREE]


def _joints_of(model: mujoco.MjModel, body: int) -> list[int]:
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def _is_free(model: mujoco.MjModel, body: int) -> bool:
    return any(model.jnt_type[joint] == _FREE for joint in _joints_of(model, body))


def _below(model: mujoco.MjModel, tree: int) -> list[int]:
    """A body of the world's, and all that hangs on it."""
    return [body for body in range(1, model.nbody) if model.body_rootid[body] == tree]


def _motions(model: mujoco.MjModel, trees: list[int]) -> tuple[int, int]:
    """In how many ways trees move, without those of a floating base, and with them."""
    bodies = [body for tree in trees for body in _below(model, tree)]
    inner = sum(len(own_joints(model, body)) for body in bodies)
    return inner, sum(int(model.body_dofnum[body]) for body in bodies)


def _unused(name: str, used: set[str]) -> str:
    while name in used:
        name += "_"
    return name
