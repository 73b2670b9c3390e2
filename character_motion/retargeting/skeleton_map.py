"""Which joint of a skeleton is which of a body: by names and by the tree, or as a file says."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from character_motion.retargeting.joint_names import (
    ARM,
    HEAD,
    LEFT,
    LEG,
    NECK,
    RIGHT,
    PartWeights,
    side_and_part,
)
from msgs_config import files
from msgs_config.errors import ClipError, one_of
from msgs_config.mappings import MappingReader

SIDES = (LEFT, RIGHT)
_LIMB = ("hip", "knee", "ankle", "toe", "collar", "shoulder", "elbow", "wrist")
_TRUNK = ("pelvis", "chest", "neck", "head")
ROLES = (*_TRUNK, *(f"{side}_{part}" for part in _LIMB for side in SIDES))
"""What a joint can be. A pelvis carries both hips, a chest both arms."""
_LEGS = [f"{side}_{part}" for part in ("hip", "knee", "ankle") for side in SIDES]
_REQUIRED_ROLES = [*_LEGS, *(f"{side}_{part}" for part in ("shoulder", "elbow") for side in SIDES)]
_SHOWN_NAMES = 40

Chain = Sequence[tuple[str, PartWeights]]
Parts = Sequence[Sequence[tuple[str, str]]]
"""Of each joint, the side and the part that each of its names says."""


@dataclass(frozen=True)
class SkeletonMap:
    """Indices of the joints of a skeleton by their roles, from `ROLES`."""

    joints: Mapping[str, int]

    def __getitem__(self, role: str) -> int:
        return self.joints[role]

    def __contains__(self, role: str) -> bool:
        return role in self.joints

    def swapped(self) -> "SkeletonMap":
        """The map with left and right exchanged."""
        return SkeletonMap({other_side(role): joint for role, joint in self.joints.items()})


def other_side(role: str) -> str:
    """The role of the same part on the other side; a role of the trunk is its own."""
    side, _, part = role.partition("_")
    return {LEFT: f"{RIGHT}_{part}", RIGHT: f"{LEFT}_{part}"}.get(side, role)


def find_map(
    place: object,
    names: Sequence[str],
    parents: Sequence[int],
    given: Mapping[str, str] | None = None,
    *,
    parts: Parts | None = None,
    arms: bool = True,
) -> SkeletonMap:
    """The map of a skeleton of j joints.

    Args:
        place: The file that it comes from, for errors.
        names: Of the joints (j,).
        parents: Index of each joint's parent, -1 of the root; parents come first.
        given: Joints by role, which take precedence over what the names say.
        parts: Of each joint, the sides and parts that it may be, where names have more to say.
        arms: Whether arms are needed.

    Raises:
        ClipError: a joint that is needed is not found, or one that is given does not exist.
    """
    if parts is None:
        parts = [(side_and_part(name),) for name in names]
    found: dict[str, int] = {}
    for side in SIDES:
        for chain in (LEG, ARM):
            best = _best_chain(chain, side, parts, parents)
            found |= {f"{side}_{part}": joint for part, joint in best.items()}
    for role, name in (given or {}).items():
        if name not in names:
            raise ClipError(f"{place}: map: {role}: {one_of('joint', name, list(names))}")
        found[role] = list(names).index(name)
    needed = _REQUIRED_ROLES if arms else _LEGS
    missing = [role for role in needed if role not in found]
    if missing:
        raise ClipError(
            f"{place}: no joint found for {', '.join(missing)}; name them in a file for --map, "
            f"such as '{missing[0]}: NAME'; joints: {', '.join(names[:_SHOWN_NAMES])}"
        )
    return SkeletonMap(_with_trunk(found, parts, parents))


@dataclass(frozen=True)
class GivenJoints:
    """What a file says of joints by role: of a captured skeleton, and of a character."""

    source: Mapping[str, str]
    target: Mapping[str, str]  # names of links, or of joints


def read_map(path: Path) -> GivenJoints:
    """A YAML file of joints by role, such as `left_knee: LeftLeg`.

    Those of the character are under `target`; those of the capture at the top, or under `source`.

    Raises:
        ClipError: it is malformed, or names a role that does not exist.
    """
    content = files.parse_yaml_mapping(path, files.read_text(path, ClipError), ClipError)
    reader = MappingReader(path, content, ClipError)
    reader.check_keys((*ROLES, "source", "target"))
    source, target = reader.part("source"), reader.part("target")
    for part in (source, target):
        part.check_keys(ROLES)
    at_top = {role: reader.text(role) for role in content if role in ROLES}
    return GivenJoints(
        source=at_top | {role: source.text(role) for role in source.content},
        target={role: target.text(role) for role in target.content},
    )


def ancestors(joint: int, parents: Sequence[int]) -> list[int]:
    """A joint and those that it hangs on, up to the root."""
    line = []
    while joint >= 0:
        line.append(joint)
        joint = parents[joint]
    return line


def common_ancestor(joints: Sequence[int], parents: Sequence[int]) -> int:
    """The lowest joint that all of some joints hang on, or are."""
    lines = [ancestors(joint, parents) for joint in joints]
    return next(joint for joint in lines[0] if all(joint in line for line in lines))


def _best_chain(chain: Chain, side: str, parts: Parts, parents: Sequence[int]) -> dict[str, int]:
    """The joints of a limb: one line from the trunk on whose names fit its parts best.

    Of joints that fit equally well, the one nearest to the trunk.
    """
    best: list[list[tuple[float, tuple[tuple[str, int], ...]]]] = []
    nothing: tuple[float, tuple[tuple[str, int], ...]] = (0.0, ())
    for joint, names in enumerate(parts):
        own = {part for own_side, part in names if own_side == side}
        above = best[parents[joint]] if parents[joint] >= 0 else [nothing] * (len(chain) + 1)
        row = list(above)
        if own:
            for level, (role, weights) in enumerate(chain):
                weight = max(weights.get(part, 0.0) for part in own)
                if weight > 0.0:
                    score, taken = max(above[: level + 1], key=lambda each: each[0])
                    if score + weight > row[level + 1][0]:
                        row[level + 1] = score + weight, (*taken, (role, joint))
        best.append(row)
    ends = [each for row in best for each in row]
    return dict(max(ends, key=lambda each: each[0], default=nothing)[1])


def _with_trunk(found: dict[str, int], parts: Parts, parents: Sequence[int]) -> dict[str, int]:
    """The joints with those of the trunk, which the tree says better than names do."""
    hips, arms = (
        [found[f"{side}_{part}"] for side in SIDES if f"{side}_{part}" in found]
        for part in ("hip", "shoulder")
    )
    pelvis = common_ancestor(hips, parents)
    chest = common_ancestor(arms, parents) if len(arms) == len(SIDES) else pelvis
    if (
        any(part in NECK for _, part in parts[chest]) and parents[chest] >= 0
    ):  # a biped's collars hang on its neck
        chest = parents[chest]
    result = {"pelvis": pelvis, "chest": chest}
    for role, words in (("neck", NECK), ("head", HEAD)):
        for joint, names in enumerate(parts):
            if any(part in words for _, part in names) and chest in ancestors(joint, parents):
                result.setdefault(role, joint)
    if "head" not in result and "neck" in result:
        result["head"] = result["neck"]
    if "neck" not in result and "head" in result:
        result["neck"] = result["head"]
    return {**result, **found}
