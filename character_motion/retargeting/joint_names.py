"""What the names of joints say: their side, and the part of a body that they move.

Makers of motion capture call the same joint `LeftUpLeg`, `lThigh`, `L_Hip`, `Bip01 L Thigh` or
`mixamorig:LeftUpLeg`. A name is split into words, of which some say the side and some nothing.
"""

import re
from collections.abc import Mapping

LEFT, RIGHT = "left", "right"

_WORDS = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SIDES = {"left": LEFT, "l": LEFT, "lft": LEFT, "right": RIGHT, "r": RIGHT, "rgt": RIGHT}
_WORDS_WITHOUT_ROLE = re.compile(  # words that say whose joint it is, or that it is one
    r"(mixamorig|bip|character|skeleton|skel|rig|armature|def|jnt|jt|j|b|bone|cc|base|bend|c|ctrl)\d*"
)
_SIDE_AND_WORD = re.compile(r"([lr])([uf])")  # such as `LUArm`, the left upper arm
_HELPERS = re.compile(
    r"twist|roll|nub|dummy|helper|pole|phys|thumb|index|middle|ring|pinky|little|finger|prop|eye|jaw"
)

_OF_ROBOTS = re.compile(  # words of hinges, which say their axis, or that there is one
    r"link|joint|motor|dof|actuator|drive|servo|body|pitch|roll|yaw|[xyz]|rx|ry|rz|fe|aa|ie|fork|cross"
)

PartWeights = Mapping[str, float]

LEG: tuple[tuple[str, PartWeights], ...] = (
    (
        "hip",
        {
            "upleg": 1,
            "upperleg": 1,
            "thigh": 1,
            "femur": 1,
            "uleg": 1,
            "legupper": 1,
            "hip": 0.8,
            "leg": 0.4,
        }
        | {"hipjoint": 0.3, "buttock": 0.2},
    ),
    (
        "knee",
        {"knee": 1, "calf": 1, "shin": 1, "tibia": 1, "lowleg": 1, "lowerleg": 1, "lleg": 1}
        | {"shank": 1, "leglower": 1, "leg": 0.9, "kneejoint": 1},
    ),
    ("ankle", {"ankle": 1, "foot": 0.9, "anklejoint": 1, "talus": 1}),
    ("toe", {"toe": 1, "toes": 1, "toebase": 1, "ball": 1, "toejoint": 1, "foot": 0.4}),
)
"""The joints of a leg from the trunk on, with the parts that they are called by, and how surely."""

ARM: tuple[tuple[str, PartWeights], ...] = (
    (
        "collar",
        {"clavicle": 1, "collar": 1, "collarbone": 1, "torsoclavicle": 1, "shoulder": 0.6}
        | {"scapula": 0.5, "claviclejoint": 1},
    ),
    (
        "shoulder",
        {"upperarm": 1, "uparm": 1, "uarm": 1, "humerus": 1, "shldr": 1, "arm": 0.9}
        | {"shoulder": 0.7, "shoulderjoint": 1, "armupper": 1, "bicep": 1},
    ),
    (
        "elbow",
        {"forearm": 1, "farm": 1, "lowerarm": 1, "lowarm": 1, "elbow": 1, "radius": 1, "larm": 1}
        | {"elbowjoint": 1, "armlower": 1, "arm": 0.3},
    ),
    ("wrist", {"wrist": 1, "hand": 0.9, "wristjoint": 1}),
)
NECK = frozenset({"neck", "lowerneck", "upperneck", "torsohead", "cervical"})
HEAD = frozenset({"head"})
_PARTS = {part for chain in (LEG, ARM) for _, parts in chain for part in parts} | NECK | HEAD


def side_and_part(name: str, *, of_robot: bool = False) -> tuple[str, str]:
    """The side that a joint's name says, `left`, `right` or empty, and the part; empty for none.

    Helpers such as fingers and joints of twist are no parts; of a robot, whose hinges are called
    `left_hip_roll_joint`, axes are left out.
    """
    last = re.split(r"[:|/]", name.strip())[-1]
    found = " ".join(_WORDS.findall(last)).lower()
    words = " ".join(
        _SIDE_AND_WORD.sub(r"\1 \2", w) if len(w) == 2 else w for w in found.split()
    ).split()
    if of_robot:
        words = [word for word in words if not _OF_ROBOTS.fullmatch(word)]
    if _HELPERS.search("".join(words)):
        return "", ""
    if len(words) > 1 and words[0] == "joint":
        words = words[1:]
    words = [word for word in words if not (word.isdigit() or _WORDS_WITHOUT_ROLE.fullmatch(word))]
    sides = [_SIDES[word] for word in words if word in _SIDES]
    rest = "".join(word for word in words if word not in _SIDES)
    if sides:
        return sides[0], rest
    return _side_within("".join(words))


def _side_within(compact: str) -> tuple[str, str]:
    """Side and part of a name in one case, such as `lfemur`, `LEFTKNEE` or `hipleft`."""
    for word, side in _SIDES.items():
        for rest in (compact.removeprefix(word), compact.removesuffix(word)):
            if rest != compact and rest in _PARTS:
                return side, rest
    return "", compact
