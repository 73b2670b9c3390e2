"""Characters of any number of hinges, to measure how cost grows."""

from pathlib import Path

_LENGTH, _MASS = 0.1, 0.1  # m and kg of a link
_AXES = ("1 0 0", "0 1 0")  # axes of the hinges in turn, so that it moves in three dimensions


def write_chain(directory: Path, hinges: int) -> Path:
    """Write a hanging chain of thin rods as URDF and YAML; returns the character's file."""
    links = ['<link name="anchor"/>']
    for index in range(hinges):
        links.append(_link(index))
        links.append(_joint(index, f"link_{index - 1}" if index else "anchor"))
    urdf = directory / f"chain_{hinges}.urdf"
    urdf.write_text(f'<robot name="{urdf.stem}">\n' + "\n".join(links) + "\n</robot>\n")
    character = urdf.with_suffix(".yaml")
    character.write_text(f"urdf: {urdf.name}\nfixed_base: true\ninertia: file\n")
    return character


def _link(index: int) -> str:
    inertia = _MASS * _LENGTH**2 / 12.0
    return (
        f'<link name="link_{index}"><inertial><origin xyz="0 0 {-0.5 * _LENGTH}"/>'
        f'<mass value="{_MASS}"/><inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" '
        f'iyz="0" izz="{0.1 * inertia}"/></inertial></link>'
    )


def _joint(index: int, parent: str) -> str:
    return (
        f'<joint name="hinge_{index}" type="continuous"><parent link="{parent}"/>'
        f'<child link="link_{index}"/><origin xyz="0 0 {-_LENGTH if index else 0.0}"/>'
        f'<axis xyz="{_AXES[index % 2]}"/><limit effort="1000" velocity="1000"/></joint>'
    )
