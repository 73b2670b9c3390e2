"""Links without mass that are fixed to others: frames, merged into what they are fixed to."""

from collections.abc import Iterable
from xml.etree import ElementTree

from msgs_config.character.model import Frame
from msgs_config.character.urdf.inertia import read_inertial
from msgs_config.character.urdf.origin import move_origin, read_origin
from msgs_config.character.urdf.reading import FLOATING

MAX_JOINTS = 127
"""That the engine can hold, without those of mere frames, which are merged before it reads them."""

_POSED_ELEMENTS = ("inertial", "visual", "collision")


def joint_end(joint: ElementTree.Element, which: str) -> str:
    """The name of a joint's `parent` or `child`; empty where it has none."""
    element = joint.find(which)
    return "" if element is None else element.get("link", "")


def has_massless_base(robot: ElementTree.Element) -> bool:
    """Whether the base is fixed for ROS: called `world` and without inertial, or without any mass.

    Its mass is also that of the links which are fixed to it. One on a joint that floats is not.
    """
    tree = LinkTree(robot)
    base = tree.base()
    if any(joint.get("type") == FLOATING for joint in robot.findall("joint")):
        return False
    if base.get("name") == "world" and base.find("inertial") is None:
        return True
    group = [base]
    for link in group:
        group += [tree.below(joint) for joint in tree.fixed_to(link)]
    return all(read_inertial(link).mass == 0.0 for link in group)


def find_frames(robot: ElementTree.Element) -> list[ElementTree.Element]:
    """The joints to links that are mere frames of the links above: fixed, and without inertial.

    Where the engine could not hold the others, also those to links that have no mass by number.
    """
    links = {link.get("name", ""): link for link in robot.findall("link")}
    joints = robot.findall("joint")
    fixed = [joint for joint in joints if joint.get("type") == "fixed"]
    frames = [joint for joint in fixed if links[joint_end(joint, "child")].find("inertial") is None]
    if len(joints) - len(frames) > MAX_JOINTS:
        return [j for j in fixed if read_inertial(links[joint_end(j, "child")]).is_nothing]
    return frames


class LinkTree:
    """The links of a URDF, of which some are merged into those above them; changes the URDF."""

    def __init__(self, robot: ElementTree.Element) -> None:
        self.frames: list[Frame] = []
        """The links that were merged; a frame that others are in comes after them."""
        self._robot = robot
        self._links = {link.get("name", ""): link for link in robot.findall("link")}
        self._joints = robot.findall("joint")

    def fix_empty_joints(self) -> list[str]:
        """Fix the joints that move no mass and no inertia, sliders without mass; their names.

        Where nothing in the robot has any, they stay, and the robot cannot be moved.
        """
        inertials = {name: read_inertial(link) for name, link in self._links.items()}
        moved = self._with_all_above(name for name, own in inertials.items() if not own.is_nothing)
        heavy = self._with_all_above(name for name, own in inertials.items() if own.mass)
        fixed = []
        for joint in self._joints if moved else ():
            needed = heavy or moved if joint.get("type") == "prismatic" else moved
            if joint.get("type") != "fixed" and joint_end(joint, "child") not in needed:
                joint.set("type", "fixed")
                fixed.append(joint.get("name", ""))
        return fixed

    def _with_all_above(self, names: Iterable[str]) -> set[str]:
        """The names of links, and of all that lead from the base to them."""
        above = {joint_end(joint, "child"): joint_end(joint, "parent") for joint in self._joints}
        found = set[str]()
        for name in names:
            while name not in found:
                found.add(name)
                name = above.get(name, name)
        return found

    def merge_frames(self) -> dict[str, str]:
        """Merge all frames; returns the name of each, with that of the link it is merged into."""
        for joint in find_frames(self._robot):
            self._merge(joint)
        merged: dict[str, str] = {}
        for frame in reversed(self.frames):
            merged[frame.name] = merged.get(frame.parent, frame.parent)
        return dict(reversed(merged.items()))

    def give_base_mass(self) -> list[str]:
        """Merge links that are fixed to a base without mass into it, the heaviest first.

        Until it has mass, or until there are none; returns their names.
        """
        if not self._links:
            return []  # a terrain that was not checked, which the engine refuses
        base = self.base()
        merged = []
        while read_inertial(base).is_nothing:
            fixed = self.fixed_to(base)
            if not fixed:
                break
            joint = max(fixed, key=lambda joint: read_inertial(self.below(joint)).mass)
            for inertial in base.findall("inertial"):
                base.remove(inertial)
            self._merge(joint)
            merged.append(self.frames[-1].name)
        return merged

    def base(self) -> ElementTree.Element:
        """The link above all others."""
        (name,) = set(self._links) - {joint_end(joint, "child") for joint in self._joints}
        return self._links[name]

    def below(self, joint: ElementTree.Element) -> ElementTree.Element:
        """The link that a joint leads to."""
        return self._links[joint_end(joint, "child")]

    def fixed_to(self, link: ElementTree.Element) -> list[ElementTree.Element]:
        """The fixed joints whose parent a link is."""
        name = link.get("name")
        fixed = [joint for joint in self._joints if joint.get("type") == "fixed"]
        return [joint for joint in fixed if joint_end(joint, "parent") == name]

    def _merge(self, joint: ElementTree.Element) -> None:
        """Give a link all that the link below a fixed joint has: shapes, inertia, joints."""
        parent, child, pose = joint_end(joint, "parent"), self.below(joint), read_origin(joint)
        name = child.get("name", "")
        self.frames.append(Frame(name, parent, joint.get("name", ""), pose))
        self._robot.remove(joint)
        self._robot.remove(child)
        self._joints.remove(joint)
        for inertial in child.findall("inertial") if read_inertial(child).is_nothing else ():
            child.remove(inertial)
        del self._links[name]
        for part in child:
            if part.tag in _POSED_ELEMENTS:
                move_origin(part, pose)
                self._links[parent].append(part)
        for other in self._joints:
            end = other.find("parent")
            if end is not None and end.get("link") == name:
                move_origin(other, pose)
                end.set("link", parent)
