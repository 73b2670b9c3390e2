"""A humanoid robot whose hips, ankles and shoulders are hinges that cross, as robots have them."""

from collections.abc import Callable, Iterator
from pathlib import Path

Naming = Callable[[str, str, int], str]
"""The name of a joint by side, by part with axis (`hip_pitch`), and by its number in the limb."""


def ros(side: str, part: str, number: int) -> str:
    """As most makers of robots: `left_hip_pitch`."""
    del number
    return f"{side}_{part}"


def short(side: str, part: str, number: int) -> str:
    """With a letter for the side: `l_hip_pitch`."""
    del number
    return f"{side[0]}_{part}"


def camel(side: str, part: str, number: int) -> str:
    """In one word: `leftHipPitch`."""
    del number
    return side + "".join(word.capitalize() for word in part.split("_"))


def suffixed(side: str, part: str, number: int) -> str:
    """With the side behind: `Hip_Pitch_Left`."""
    del number
    return "_".join(word.capitalize() for word in (*part.split("_"), side))


def numbered(side: str, part: str, number: int) -> str:
    """By number alone: `leg_l1`."""
    limb = "leg" if part.split("_")[0] in ("hip", "knee", "ankle") else "arm"
    return f"{limb}_{side[0]}{number}"


NAMINGS = (ros, short, camel, suffixed, numbered)

# part, axis, origin in the parent (y of the left side), limits, shape: size of a box, its centre
_LEG = (
    ("hip_pitch", "0 1 0", (0.0, 0.06, -0.05), (-2.5, 1.5), None),
    ("hip_roll", "1 0 0", (0.0, 0.04, -0.02), (-1.0, 1.0), None),
    ("hip_yaw", "0 0 1", (0.0, 0.0, -0.1), (-1.5, 1.5), ((0.09, 0.09, 0.18), (0, 0, -0.1))),
    ("knee", "0 1 0", (-0.01, 0.0, -0.22), (-0.1, 2.6), ((0.08, 0.08, 0.2), (0, 0, -0.14))),
    ("ankle_pitch", "0 1 0", (0.01, 0.0, -0.32), (-1.0, 0.8), None),
    ("ankle_roll", "1 0 0", (0.0, 0.0, -0.02), (-0.5, 0.5), ((0.2, 0.08, 0.03), (0.04, 0, -0.03))),
)
_ARM = (
    ("shoulder_pitch", "0 1 0", (0.0, 0.12, 0.3), (-3.0, 2.6), None),
    ("shoulder_roll", "1 0 0", (0.0, 0.05, 0.0), (-2.5, 2.5), None),
    ("shoulder_yaw", "0 0 1", (0.0, 0.0, -0.1), (-2.6, 2.6), ((0.06, 0.06, 0.12), (0, 0, 0))),
    ("elbow", "0 1 0", (0.01, 0.0, -0.1), (-2.4, 1.2), ((0.16, 0.05, 0.05), (0.1, 0, 0))),
)


def write_robot(path: Path, naming: Naming = ros, *, arms: bool = True) -> Path:
    """Write a robot's URDF; at zero its forearms point ahead. It has no key for clips."""
    parts = [_link("pelvis", ((0.1, 0.14, 0.08), (0, 0, 0)), 8.0)]
    parts.append(_link("torso", ((0.12, 0.16, 0.24), (0, 0, 0.16)), 12.0))
    parts.append(_joint("waist_yaw", "pelvis", "torso", "0 0 1", (0, 0, 0.05), (-2.0, 2.0)))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        parts += _limb(naming, side, sign, "pelvis", _LEG)
        if arms:
            parts += _limb(naming, side, sign, "torso", _ARM)
    path.write_text(f'<robot name="hinged">{"".join(parts)}</robot>\n')
    return path


def _limb(naming: Naming, side: str, sign: float, parent: str, rows: tuple) -> Iterator[str]:  # type: ignore[type-arg]
    for number, (part, axis, origin, limits, box) in enumerate(rows, start=1):
        name = naming(side, part, number)
        place = (origin[0], sign * origin[1], origin[2])
        yield _link(f"{name}_link", box, 1.0)
        yield _joint(f"{name}_joint", parent, f"{name}_link", axis, place, limits)
        parent = f"{name}_link"


def _link(name: str, box: tuple | None, mass: float) -> str:  # type: ignore[type-arg]
    size, centre = box or ((0.05, 0.05, 0.05), (0, 0, 0))
    pose = f'<origin xyz="{_text(centre)}"/>'
    x, y, z = (mass * (sum(s * s for s in size) - own * own) / 12.0 for own in size)
    inertia = f'<inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/>'
    shape = f'{pose}<geometry><box size="{_text(size)}"/></geometry>'
    collision = f"<collision>{shape}</collision>" if box else ""
    return (
        f'<link name="{name}"><inertial>{pose}<mass value="{mass}"/>{inertia}</inertial>'
        f"<visual>{shape}</visual>{collision}</link>"
    )


def _joint(
    name: str,
    parent: str,
    child: str,
    axis: str,
    origin: tuple[float, ...],
    limits: tuple[float, float],
) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_text(origin)}"/><axis xyz="{axis}"/>'
        f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="200" velocity="20"/></joint>'
    )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(map(str, values))
