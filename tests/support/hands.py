"""URDFs of hands with light, short fingers, as humanoids have them; texts of our own."""

from collections.abc import Sequence

FINGER_LENGTHS = (0.030, 0.025, 0.020)  # m


def box_link(name: str, mass: float, size: Sequence[float], centre: Sequence[float]) -> str:
    """A link that is a box of a mass in kg, edges in m, about a centre in m."""
    x, y, z = size
    moments = (y * y + z * z, x * x + z * z, x * x + y * y)
    inertia = " ".join(
        f'{axis}="{mass * moment / 12.0!r}"'
        for axis, moment in zip(("ixx", "iyy", "izz"), moments, strict=True)
    )
    origin = f'<origin xyz="{centre[0]} {centre[1]} {centre[2]}"/>'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/>'
        f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial>'
        f'<collision>{origin}<geometry><box size="{x} {y} {z}"/></geometry></collision></link>'
    )


def hinge(name: str, parent: str, child: str, origin: str, axis: str, more: str) -> str:
    """A hinge; `more` are its limit and what else it has."""
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin {origin}/><axis xyz="{axis}"/>{more}</joint>'
    )


def hand_on_a_body(
    finger_mass: float = 0.004,
    fingers: int = 5,
    lengths: Sequence[float] = FINGER_LENGTHS,
    dynamics: str = "",
    mimics: bool = False,
) -> str:
    """A floating body of 30 kg with an arm and, below it, a hand of fingers of three links.

    `finger_mass` in kg is that of each link, `lengths` are theirs in m; `dynamics` is an element
    of each finger's joints; with `mimics` the outer joints follow the inner ones.
    """
    arm = '<limit lower="-1.5" upper="1.5" effort="30" velocity="5"/>'
    parts = [
        box_link("trunk", 30.0, (0.3, 0.3, 0.4), (0.0, 0.0, 0.0)),
        box_link("arm", 1.5, (0.06, 0.06, 0.3), (0.0, 0.0, 0.15)),
        box_link("palm", 0.3, (0.08, 0.03, 0.09), (0.0, 0.0, 0.045)),
        hinge("shoulder", "trunk", "arm", 'xyz="0 0.2 -0.1" rpy="3.14159 0 0"', "1 0 0", arm),
        hinge("wrist", "arm", "palm", 'xyz="0 0 0.3"', "0 1 0", arm),
    ]
    for finger in range(fingers):
        parent, origin = "palm", f'xyz="{-0.036 + 0.018 * finger:.3f} 0 0.09"'
        for number, length in enumerate(lengths):
            name, width = f"finger_{finger}_{number}", 0.014 - 0.002 * number
            more = f'<limit lower="0" upper="1.6" effort="1" velocity="5"/>{dynamics}'
            if mimics and number:
                more += (
                    f'<mimic joint="finger_{finger}_0_joint" multiplier="{1.0 - 0.1 * number}"/>'
                )
            parts.append(box_link(name, finger_mass, (width, width, length), (0, 0, length / 2)))
            parts.append(hinge(f"{name}_joint", parent, name, origin, "1 0 0", more))
            parent, origin = name, f'xyz="0 0 {length}"'
    return f'<robot name="hand">{"".join(parts)}</robot>'
