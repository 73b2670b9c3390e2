"""Links without mass that are fixed to others: frames, merged into what they are fixed to."""

from collections.abc import Callable
from xml.etree import ElementTree

from msgs_config.character.urdf_inertia import read_inertial
from msgs_config.character.urdf_origin import move_origin, read_origin


def is_frame(link: ElementTree.Element, joint: ElementTree.Element) -> bool:
    """Whether a link is no more than a frame of the link above it: fixed, and without inertial."""
    return joint.get("type") == "fixed" and link.find("inertial") is None


class LinkTree:
    """The links of a URDF, of which some are merged into those above them; changes the URDF."""

    def __init__(self, robot: ElementTree.Element) -> None:
        self._robot = robot
        self._links = {link.get("name", ""): link for link in robot.findall("link")}
        self._joints = robot.findall("joint")

    def fix_empty_joints(self) -> list[str]:
        """Fix the joints that move no mass and no inertia; returns their names.

        Where nothing in the robot has any, they stay, and the robot cannot be moved.
        """
        moving = {name for name, link in self._links.items() if not read_inertial(link).is_nothing}
        if not moving:
            return []
        above = {_end(joint, "child"): joint for joint in self._joints}
        needed = set[str]()
        for name in moving:
            while name in above and name not in needed:
                needed.add(name)
                name = _end(above[name], "parent")
        fixed = []
        for joint in self._joints:
            if joint.get("type") != "fixed" and _end(joint, "child") not in needed:
                joint.set("type", "fixed")
                fixed.append(joint.get("name", ""))
        return fixed

    def merge_frames(self) -> dict[str, str]:
        """Merge all frames; returns the name of each, with that of the link it is merged into."""
        merged: dict[str, str] = {}
        for joint in self._fixed(lambda child: is_frame(child, _FIXED)):
            parent, child = _end(joint, "parent"), _end(joint, "child")
            self._merge(joint)
            merged[child] = parent
        for name in merged:
            while merged[name] in merged:
                merged[name] = merged[merged[name]]
        return merged

    def give_base_mass(self) -> list[str]:
        """Merge links that are fixed to a base without mass into it, the heaviest first.

        Until it has mass, or until there are none; returns their names.
        """
        base = self.base()
        merged = []
        while read_inertial(base).is_nothing:
            fixed = [j for j in self._fixed(lambda _: True) if self._above(j) is base]
            if not fixed:
                break
            joint = max(fixed, key=lambda joint: read_inertial(self._below(joint)).mass)
            for inertial in base.findall("inertial"):
                base.remove(inertial)
            merged.append(_end(joint, "child"))
            self._merge(joint)
        return merged

    def base(self) -> ElementTree.Element:
        """The link above all others."""
        (name,) = set(self._links) - {_end(joint, "child") for joint in self._joints}
        return self._links[name]

    def _fixed(self, wanted: Callable[[ElementTree.Element], bool]) -> list[ElementTree.Element]:
        """The fixed joints to links that are wanted."""
        return [j for j in self._joints if j.get("type") == "fixed" and wanted(self._below(j))]

    def _above(self, joint: ElementTree.Element) -> ElementTree.Element:
        return self._links[_end(joint, "parent")]

    def _below(self, joint: ElementTree.Element) -> ElementTree.Element:
        return self._links[_end(joint, "child")]

    def _merge(self, joint: ElementTree.Element) -> None:
        """Give a link all that the link below a fixed joint has: shapes, inertia, joints."""
        above, below, pose = self._above(joint), self._below(joint), read_origin(joint)
        self._robot.remove(joint)
        self._robot.remove(below)
        self._joints.remove(joint)
        del self._links[below.get("name", "")]
        for part in below:
            if part.tag in _POSED:
                move_origin(part, pose)
                above.append(part)
        for other in self._joints:
            parent = other.find("parent")
            if parent is not None and parent.get("link") == below.get("name"):
                move_origin(other, pose)
                parent.set("link", above.get("name", ""))


_FIXED = ElementTree.Element("joint", type="fixed")
_POSED = ("inertial", "visual", "collision")


def _end(joint: ElementTree.Element, which: str) -> str:
    element = joint.find(which)
    return "" if element is None else element.get("link", "")
