"""Where MuJoCo keeps in its data what compiled code has no function for.

Its package tells the fields of its C structures (`mujoco.introspect`); their places follow by C's
rules. That they are right is looked up in a world that is known.
"""

import ctypes
from functools import cache
from typing import Any, NamedTuple

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.errors import SimulationError

_KINDS: dict[str, Any] = {
    "int": ctypes.c_int,
    "mjtNum": ctypes.c_double,
    "mjtBool": ctypes.c_bool,
    "mjtSize": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_size_t,
}
_KNOWN_WORLD = (
    "<mujoco><worldbody><geom type='plane' size='1 1 1'/>"
    "<body pos='0 0 .05'><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
)
_FULL = (mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL)


class DataFields(NamedTuple):
    """Places of fields, in numbers of four bytes or in words of eight, as said."""

    contacts: int  # how many there are, in numbers
    rows: int  # of all constraints, in numbers
    full: IntArray  # (k,) in numbers: how often there was no room
    contact_pointer: int  # in words
    reference_pointer: int  # in words: `efc_aref`, what the constraints ask for
    contact_words: int  # size of a contact
    point: int  # in words within a contact
    frame: int  # in words within a contact
    friction: int  # in words within a contact
    shapes: int  # in numbers within a contact
    constraint: int  # in numbers within a contact: its first row, -1 without one


class RawData(NamedTuple):
    """The memory of an `MjData`: itself, and that of what a step makes."""

    words: IntArray  # (w,)
    numbers: IntArray  # (2 w,) the same as numbers of four bytes
    arena: FloatArray  # (a,)
    arena_numbers: IntArray  # (2 a,) the same as numbers of four bytes
    arena_start: int  # its address


@cache
def data_fields() -> DataFields:
    """The places of fields in this MuJoCo's data.

    Raises:
        SimulationError: they are not where they should be.
    """
    data, contact = _structure("mjData"), _structure("mjContact")
    warning = _structure("mjWarningStat")
    full = [
        data.warning.offset + int(each) * ctypes.sizeof(warning) + warning.number.offset
        for each in _FULL
    ]
    fields = DataFields(
        contacts=data.ncon.offset // 4,
        rows=data.nefc.offset // 4,
        full=np.array(full, dtype=np.intp) // 4,
        contact_pointer=data.contact.offset // 8,
        reference_pointer=data.efc_aref.offset // 8,
        contact_words=ctypes.sizeof(contact) // 8,
        point=contact.pos.offset // 8,
        frame=contact.frame.offset // 8,
        friction=contact.friction.offset // 8,
        shapes=contact.geom.offset // 4,
        constraint=contact.efc_address.offset // 4,
    )
    _check(fields)
    return fields


def raw_data(data: mujoco.MjData) -> RawData:
    """The memory of a `MjData`, which must outlive it."""
    kind = _structure("mjData")
    size = ctypes.sizeof(kind) // 8
    words = np.ctypeslib.as_array((ctypes.c_int64 * size).from_address(data._address))
    start = int(words[kind.arena.offset // 8])
    length = int(words[kind.narena.offset // 8]) // 8
    arena = np.ctypeslib.as_array((ctypes.c_double * length).from_address(start))
    return RawData(words, words.view(np.int32), arena, arena.view(np.int32), start)


@cache
def _structure(name: str) -> Any:
    """One of MuJoCo's C structures, as ctypes has it."""
    from mujoco.introspect.structs import STRUCTS  # takes a tenth of a second

    fields = [(each.name, _kind(str(each.type))) for each in STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _kind(declared: str) -> Any:
    if declared.endswith("*"):
        return ctypes.c_void_p
    name, *extent = declared.rstrip("]").split(" [")
    kind = _KINDS[name] if name in _KINDS else _structure(name)
    return kind * int(extent[0]) if extent else kind


def _check(fields: DataFields) -> None:
    model = mujoco.MjModel.from_xml_string(_KNOWN_WORLD)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    raw = raw_data(data)
    first = (int(raw.words[fields.contact_pointer]) - raw.arena_start) // 8
    row = (int(raw.words[fields.reference_pointer]) - raw.arena_start) // 8
    found = (
        int(raw.numbers[fields.contacts]),
        int(raw.numbers[fields.rows]),
        *raw.arena[row : row + 3].tolist(),
        *raw.arena[first + fields.point : first + fields.point + 3].tolist(),
        *raw.arena[first + fields.frame : first + fields.frame + 9].tolist(),
        *raw.arena[first + fields.friction : first + fields.friction + 5].tolist(),
        *raw.arena_numbers[2 * first + fields.shapes :][:2].tolist(),
        int(raw.arena_numbers[2 * first + fields.constraint]),
    )
    contact = data.contact
    expected = (
        *(data.ncon, data.nefc, *data.efc_aref[:3].tolist()),
        *(*contact.pos[0].tolist(), *contact.frame[0].tolist()),
        *(*contact.friction[0].tolist(), *contact.geom[0].tolist()),
        int(contact.efc_address[0]),
    )
    if found != expected:
        raise SimulationError(
            f"MuJoCo {mujoco.__version__} has other structures than its package says; "
            "worlds of it cannot be simulated together"
        )
