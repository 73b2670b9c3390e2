"""The elements of a URDF that count, and a line for each kind of what does not.

URDF has no schema that its readers agree on: each takes the elements that it knows, of those of one
name the first, and passes over the rest. So does this project, and says what it passes over.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.etree import ElementTree

MAX_NAMES = 5
"""Names in a line; of the others there is the number."""
MAX_NAME = 100
"""Characters of a name in a line."""
VELOCITY = "velocity"
"""The kind of the limits that nothing keeps."""

_IGNORED_ATTRIBUTES = frozenset({"name", "version", "xmlns", "id", "type", "group"})
"""Attributes of any element that mean nothing to a simulation."""


class LeftOut(NamedTuple):
    """What does not count, of one kind."""

    kind: str
    """The name of the element or attribute."""
    line: str


@dataclass(frozen=True)
class _Known:
    """An element that counts: its attributes, and the elements in it."""

    attributes: frozenset[str] = frozenset()
    parts: dict[str, "_Known"] = field(default_factory=dict)
    repeated: frozenset[str] = frozenset()
    """Of the elements in it those of which there may be several."""


def _known(attributes: str = "", repeated: str = "", **parts: _Known) -> _Known:
    return _Known(frozenset(attributes.split()), parts, frozenset(repeated.split()))


_NUMBER = _known("value")
_ORIGIN = _known("xyz rpy")
_RADIUS_AND_LENGTH = _known("radius length")
_MATERIAL = _known("name", color=_known("rgba"))
_GEOMETRY = _known(
    box=_known("size"),
    sphere=_known("radius"),
    cylinder=_RADIUS_AND_LENGTH,
    capsule=_RADIUS_AND_LENGTH,
    mesh=_known("filename scale"),
    plane=_known("normal"),  # only a terrain may have it
)
_PART = _known(origin=_ORIGIN, geometry=_GEOMETRY, material=_MATERIAL)
_INERTIAL = _known(
    origin=_ORIGIN,
    mass=_NUMBER,
    inertia=_known("ixx ixy ixz iyy iyz izz iyx izx izy"),
)
_FRICTION = "lateral_friction"
_CONTACT = (  # Bullet's own elements
    f"{_FRICTION} inertia_scaling rolling_friction spinning_friction restitution stiffness "
    "damping contact_cfm contact_erp friction_anchor"
)
_ROBOT = _known(
    repeated="link joint material",
    link=_known(
        repeated="visual collision",
        inertial=_INERTIAL,
        visual=_PART,
        collision=_known("concave", origin=_ORIGIN, geometry=_GEOMETRY, material=_MATERIAL),
        contact=_Known(parts=dict.fromkeys(_CONTACT.split(), _NUMBER)),
    ),
    joint=_known(
        origin=_ORIGIN,
        parent=_known("link"),
        child=_known("link"),
        axis=_known("xyz"),
        limit=_known("lower upper effort velocity"),
        dynamics=_known("damping friction armature"),
        mimic=_known("joint multiplier offset"),
    ),
    material=_MATERIAL,
)


def leave_out_unknown(robot: ElementTree.Element) -> tuple[LeftOut, ...]:
    """Remove all elements of a URDF's root that do not count; a line of each kind of what does not.

    Also of attributes, which stay, and of limits that nothing keeps.
    """
    found = _Collector()
    found.read(robot, _ROBOT, "")
    for joint in robot.findall("joint"):
        _read_joint(joint, found)
    for link in robot.findall("link"):
        if link.find(f"contact/{_FRICTION}") is not None:
            what = f"<{_FRICTION}>, for which the parameter 'link_friction' stands"
            found.add(_FRICTION, what, link.get("name", ""))
    return found.lines()


class _Collector:
    """What does not count, by its kind."""

    def __init__(self) -> None:
        self._places: dict[tuple[str, str], list[str]] = {}

    def add(self, kind: str, what: str, place: str) -> None:
        # a line has no other lines in it, whatever the file has for names
        place = " ".join(place.split())[:MAX_NAME]
        self._places.setdefault((kind, what), []).append(place)

    def read(self, element: ElementTree.Element, known: _Known, place: str) -> None:
        """Remove what does not count from an element; `place` is the link or joint round it."""
        for name in element.attrib:
            if name not in known.attributes and name.partition(":")[0] not in _IGNORED_ATTRIBUTES:
                self.add(name, f"'{name[:MAX_NAME]}' of <{element.tag}>", place)
        counted = set[str]()
        for part in list(element):
            name = place or part.get("name") or part.get("reference") or ""
            if part.tag not in known.parts:
                if known is _GEOMETRY and not any(each.tag in known.parts for each in element):
                    continue  # it stands where the shape belongs, and is refused for that
                element.remove(part)
                where = f" in <{element.tag}>" if part.tag in _TAGS else ""
                self.add(part.tag, f"<{part.tag[:MAX_NAME]}>{where}", name)
            elif part.tag in counted and part.tag not in known.repeated:
                element.remove(part)
                self.add(part.tag, f"all but the first <{part.tag}> of a {element.tag}", name)
            else:
                counted.add(part.tag)
                self.read(part, known.parts[part.tag], name)

    def lines(self) -> tuple[LeftOut, ...]:
        """A line of each kind, in the order in which they were found."""
        return tuple(
            LeftOut(kind, f"left out: {what} ({len(places)}){_listed_once(places)}")
            for (kind, what), places in self._places.items()
        )


def _read_joint(joint: ElementTree.Element, found: _Collector) -> None:
    """Find the numbers of a joint's known elements that mean nothing for its type."""
    kind, name, limit = joint.get("type"), joint.get("name", ""), joint.find("limit")
    if limit is not None and kind != "fixed":
        if _is_given(limit, VELOCITY):
            found.add(VELOCITY, "velocity limits, which nothing keeps", name)
        if kind != "revolute" and kind != "prismatic" and _is_given(limit, "lower", "upper"):
            found.add("limit", f"'lower' and 'upper' of a {kind} joint", name)
    dynamics = joint.find("dynamics")
    if dynamics is not None and kind == "spherical" and _is_given(dynamics, "damping", "friction"):
        found.add("dynamics", "<dynamics> of a spherical joint", name)


def _is_given(element: ElementTree.Element, *names: str) -> bool:
    """Whether an element has an attribute that is not 0."""
    texts = [element.get(name, "0") for name in names]
    return any(text.strip(" +-.0") != "" for text in texts)


def listed(names: Iterable[str]) -> str:
    """Some names, and how many more there are."""
    names = list(names)
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more} more" if more > 0 else "")


def _listed_once(places: list[str]) -> str:
    names = listed(name for name in dict.fromkeys(places) if name)
    return f": {names}" if names else ""


def _tags(known: _Known) -> set[str]:
    return set(known.parts).union(*(_tags(part) for part in known.parts.values()))


_TAGS = _tags(_ROBOT)
"""The names of all elements that count somewhere."""
