"""`TFMessage` for processes under test: rclpy publishes and takes it, as serialised bytes only.

The wheels have rosidl's runtime; a type support is two structures, here TransformStamped's with
another name and hash, and a description of the one field. Fast DDS announces what it announces of
a real one. What would convert a message from and to Python is not there.
"""

import ctypes
import json
from pathlib import Path

from geometry_msgs.msg import Polygon, TransformStamped

_DEFINITION = Path(__file__).parents[2] / "share/tf2_msgs/msg/TFMessage.json"
_FAST_DDS = b"rosidl_typesupport_fastrtps_c"
_INTROSPECTION = b"rosidl_typesupport_introspection_c"
_FIND = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)
_GET = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p)


class _TypeSupport(ctypes.Structure):
    """`rosidl_message_type_support_t` of Jazzy."""

    _fields_ = (
        ("identifier", ctypes.c_char_p),
        ("data", ctypes.c_void_p),
        ("find", _FIND),
        ("get_hash", _GET),
        ("get_description", _GET),
        ("get_sources", _GET),
    )


class _Callbacks(ctypes.Structure):
    """`message_type_support_callbacks_t` of rosidl_typesupport_fastrtps_cpp."""

    _fields_ = (
        ("namespace", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("functions", ctypes.c_void_p * 4),
        ("key", ctypes.c_void_p),
    )


class _Member(ctypes.Structure):
    """`rosidl_typesupport_introspection_c__MessageMember`."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("type_id", ctypes.c_uint8),
        ("string_upper_bound", ctypes.c_size_t),
        ("members", ctypes.c_void_p),
        ("is_key", ctypes.c_bool),
        ("is_array", ctypes.c_bool),
        ("array_size", ctypes.c_size_t),
        ("is_upper_bound", ctypes.c_bool),
        ("offset", ctypes.c_uint32),
        ("default_value", ctypes.c_void_p),
        ("functions", ctypes.c_void_p * 6),
    )


class _Members(ctypes.Structure):
    """`rosidl_typesupport_introspection_c__MessageMembers`."""

    _fields_ = (
        ("namespace", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("count", ctypes.c_uint32),
        ("size", ctypes.c_size_t),
        ("has_key", ctypes.c_bool),
        ("members", ctypes.c_void_p),
        ("functions", ctypes.c_void_p * 2),
    )


def _find(message_type: type, kind: bytes) -> _TypeSupport:
    """An installed type's type support of a kind."""
    metaclass = type(message_type)
    if metaclass._TYPE_SUPPORT is None:
        metaclass.__import_type_support__()
    get = ctypes.pythonapi.PyCapsule_GetPointer
    get.restype, get.argtypes = ctypes.c_void_p, (ctypes.py_object, ctypes.c_char_p)
    general = get(metaclass._TYPE_SUPPORT, None)
    return _TypeSupport.from_address(_TypeSupport.from_address(general).find(general, kind))


def _read_hash() -> bytes:
    """The type's hash as `rosidl_type_hash_t`: a version and 32 bytes."""
    entries = json.loads(_DEFINITION.read_text())["type_hashes"]
    (text,) = [e["hash_string"] for e in entries if e["type_name"] == "tf2_msgs/msg/TFMessage"]
    return b"\1" + bytes.fromhex(text.removeprefix("RIHS01_"))


def _make() -> tuple[object, list[object]]:
    """The capsule of the type support, and what must live as long."""
    fast = _TypeSupport.from_buffer_copy(_find(TransformStamped, _FAST_DDS))
    callbacks = _Callbacks.from_buffer_copy(_Callbacks.from_address(fast.data))
    callbacks.namespace, callbacks.name = b"tf2_msgs::msg", b"TFMessage"
    fast.data = ctypes.addressof(callbacks)

    described = _TypeSupport.from_buffer_copy(_find(Polygon, _INTROSPECTION))  # a list, too
    members = _Members.from_buffer_copy(_Members.from_address(described.data))
    member = _Member.from_buffer_copy(_Member.from_address(members.members))
    member.name = b"transforms"
    member.members = ctypes.addressof(_find(TransformStamped, _INTROSPECTION))
    members.namespace, members.name = b"tf2_msgs__msg", b"TFMessage"
    members.members, described.data = ctypes.addressof(member), ctypes.addressof(members)

    own = {_FAST_DDS: ctypes.addressof(fast), _INTROSPECTION: ctypes.addressof(described)}
    digest = ctypes.create_string_buffer(_read_hash(), 33)
    find = _FIND(lambda handle, kind: own.get(kind))
    get_hash = _GET(lambda handle: ctypes.addressof(digest))
    for each in (fast, described):
        each.find, each.get_hash = find, get_hash
    new = ctypes.pythonapi.PyCapsule_New
    new.restype = ctypes.py_object
    new.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)
    owned = [fast, callbacks, described, members, member, digest, find, get_hash]
    return new(own[_FAST_DDS], None, None), owned


class _Metaclass(type):
    _TYPE_SUPPORT, _owned = _make()
    # rclpy asks whether they are there; bytes need none of them
    _CREATE_ROS_MESSAGE = type(TransformStamped)._CREATE_ROS_MESSAGE
    _CONVERT_FROM_PY = type(TransformStamped)._CONVERT_FROM_PY
    _CONVERT_TO_PY = type(TransformStamped)._CONVERT_TO_PY
    _DESTROY_ROS_MESSAGE = type(TransformStamped)._DESTROY_ROS_MESSAGE


class TFMessage(metaclass=_Metaclass):
    """`geometry_msgs/TransformStamped[] transforms`, serialised."""


TFMessage.__module__ = "tf2_msgs.msg._tf_message"
