"""Links without mass that are fixed to others: frames, merged into what they are fixed to."""

from xml.etree import ElementTree

from msgs_config.character.urdf_inertia import read_inertial
from msgs_config.character.urdf_origin import move_origin, read_origin

MAX_JOINTS = 127
"""That the engine can hold, without those of mere frames, which are merged before it reads them."""


def find_frames(robot: ElementTree.Element) -> list[ElementTree.Element]:
    """The joints to links that are mere frames of the links above: fixed, and without inertial.

    Where the engine could not hold the others, also those to links that have no mass by number.
    """
    links = {link.get("name", ""): link for link in robot.findall("link")}
    joints = robot.findall("joint")
    fixed = [joint for joint in joints if joint.get("type") == "fixed"]
    frames = [joint for joint in fixed if links[_end(joint, "child")].find("inertial") is None]
    if len(joints) - len(frames) > MAX_JOINTS:
        return [j for j in fixed if read_inertial(links[_end(j, "child")]).is_nothing]
    return frames


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
        for joint in find_frames(self._robot):
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
            fixed = [
                joint
                for joint in self._joints
                if joint.get("type") == "fixed" and self._above(joint) is base
            ]
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
        for inertial in below.findall("inertial") if read_inertial(below).is_nothing else ():
            below.remove(inertial)
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


_POSED = ("inertial", "visual", "collision")


def _end(joint: ElementTree.Element, which: str) -> str:
    element = joint.find(which)
    return "" if element is None else element.get("link", "")
