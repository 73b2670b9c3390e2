"""What SpawnEntity asks for, as a ball or a box that is let go. No ROS in here."""

import math
from typing import Any
from urllib.parse import parse_qsl
from xml.etree import ElementTree

from msgs_config.errors import CommandError
from msgs_config.messages.throw import ProjectileThrow, natural_edge, natural_radius
from sim_node.interface.standard.codes import RefusedRequestError, SpawnCode

_SHAPES = ("ball", "box")
_LARGEST_TILT = 1e-6  # of a quaternion's x and y: a box is turned about z alone
_MAX_CHARACTERS = 100_000  # of a URDF
_RIGHT = "it must be a URDF of one link with a box or sphere, or the uri ball or box"


def resource_of(request: Any) -> tuple[str, str]:
    """The uri and the text that a request has: version 2 has them in a message of their own."""
    for name in ("entity_resource", "world_resource"):
        if (resource := getattr(request, name, None)) is not None:
            return str(resource.uri), str(resource.resource_string)
    return str(request.uri), str(request.resource_string)


def requested_throw(request: Any) -> ProjectileThrow:
    """The ball or box that a request of SpawnEntity describes, at rest.

    A `uri` is `ball?mass=2&radius=0.1` or `box?mass=5&size=0.4,0.6,0.2`, in kg and m; without the
    size it has that of a light wood, without the mass 1 kg.

    Raises:
        RefusedRequestError: it describes neither, or one that cannot be.
    """
    uri, text = resource_of(request)
    if not (uri or text):
        raise RefusedRequestError(SpawnCode.NO_RESOURCE, f"there is no resource; {_RIGHT}")
    mass, radius, size = _of_uri(uri) if uri else _of_urdf(text)
    position, yaw = _placed(request.initial_pose)
    if radius is not None and radius <= 0.0:
        radius = natural_radius(mass)
    try:
        return ProjectileThrow(mass, radius, position, (0.0, 0.0, 0.0), size, yaw if size else 0.0)
    except CommandError as error:
        raise RefusedRequestError(SpawnCode.RESOURCE_PARSE_ERROR, str(error)) from error


_Body = tuple[float, float | None, tuple[float, float, float] | None]
"""Mass, radius (0: of the mass) and edges."""


def _of_uri(uri: str) -> _Body:
    shape, _, query = uri.partition("?")
    if shape not in _SHAPES:
        raise RefusedRequestError(
            SpawnCode.UNSUPPORTED_FORMAT, f"unknown uri {uri[:100]!r}; {_RIGHT}"
        )
    known = {"ball": {"mass", "radius"}, "box": {"mass", "size"}}[shape]
    given = dict(parse_qsl(query, keep_blank_values=True))
    for name in given:
        if name not in known:
            raise RefusedRequestError(
                SpawnCode.RESOURCE_PARSE_ERROR,
                f"a {shape} has no {name!r}; there are: {', '.join(sorted(known))}",
            )
    mass = _number("mass", given.get("mass", "1"))
    if shape == "ball":
        return mass, _number("radius", given.get("radius", "0")), None
    edge = natural_edge(mass)
    return mass, None, _edges(given["size"].split(",")) if "size" in given else (edge, edge, edge)


def _of_urdf(text: str) -> _Body:
    if len(text) > _MAX_CHARACTERS or "<!" in text.replace("<!--", ""):
        raise RefusedRequestError(
            SpawnCode.RESOURCE_PARSE_ERROR, f"the URDF is too long or has a DTD; {_RIGHT}"
        )
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise RefusedRequestError(
            SpawnCode.RESOURCE_PARSE_ERROR, f"the URDF is no XML: {error}"
        ) from error
    shapes = robot.findall("link/collision/geometry/*")
    links = robot.findall("link")
    if robot.tag != "robot" or len(links) != 1 or len(shapes) != 1:
        raise RefusedRequestError(
            SpawnCode.UNSUPPORTED_FORMAT, f"a <{robot.tag}> of {len(links)} links; {_RIGHT}"
        )
    element = links[0].find("inertial/mass")
    mass = _number("mass", "" if element is None else element.get("value", ""))
    (shape,) = shapes
    if shape.tag == "sphere":
        return mass, _number("radius", shape.get("radius", "")), None
    if shape.tag == "box":
        return mass, None, _edges(shape.get("size", "").split())
    raise RefusedRequestError(
        SpawnCode.UNSUPPORTED_FORMAT, f"the shape is a <{shape.tag}>; {_RIGHT}"
    )


def _number(what: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RefusedRequestError(
            SpawnCode.RESOURCE_PARSE_ERROR, f"{what} is {text[:40]!r}; it must be a number"
        )
    return value


def _edges(texts: list[str]) -> tuple[float, float, float]:
    if len(texts) != 3:
        raise RefusedRequestError(
            SpawnCode.RESOURCE_PARSE_ERROR, f"the size is {texts[:9]}; it must be 3 numbers"
        )
    x, y, z = (_number("size", text) for text in texts)
    return x, y, z


def _placed(initial_pose: Any) -> tuple[tuple[float, float, float], float]:
    """Where it begins in the world, and its turn about z (rad)."""
    frame, pose = initial_pose.header.frame_id, initial_pose.pose
    if frame not in ("", "world"):
        raise RefusedRequestError(
            SpawnCode.INVALID_POSE, f"the pose is in {frame[:100]!r}; it must be in 'world'"
        )
    turn, place = pose.orientation, pose.position
    x, y, z, w = turn.x, turn.y, turn.z, turn.w
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not 0.99 < norm < 1.01:
        raise RefusedRequestError(
            SpawnCode.INVALID_POSE, f"the quaternion's norm is {norm:g}; it must be 1"
        )
    if max(abs(x), abs(y)) > _LARGEST_TILT:
        raise RefusedRequestError(
            SpawnCode.INVALID_POSE, "it is tilted; it may be turned about z alone"
        )
    position = (float(place.x), float(place.y), float(place.z))
    if not all(map(math.isfinite, position)):
        raise RefusedRequestError(
            SpawnCode.INVALID_POSE, f"its place is {position}; it must be finite"
        )
    return position, 2.0 * math.atan2(z, w)
