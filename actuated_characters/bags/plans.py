"""What a planner said of its plans, from `~/plan`."""

from dataclasses import dataclass

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

from controller_node.interface.plan_message import FIELDS
from msgs_config.arrays import FloatArray
from msgs_config.errors import MessageError
from msgs_config.messages.clock import NANOSECONDS_PER_SECOND
from msgs_config.messages.joint_state import decode


@dataclass(frozen=True, slots=True)
class PlanArrays:
    """What was expected of a plan, at each of its c checks."""

    stamp_ns: int  # of the state that it was made in
    times: FloatArray  # (c,) s after that
    centres: FloatArray  # (c, 3) m, of mass, in the world
    costs: FloatArray  # (c,) whose sum is the plan's
    alternatives: FloatArray  # (c,) of the best of what was tried besides


def decode_plan(raw: bytes) -> PlanArrays:
    """A plan from its serialised message.

    Raises:
        MessageError: the bytes are no PointCloud2, or one without a plan's fields.
    """
    message = decode(raw, PointCloud2)
    offsets = {
        str(field.name): field.offset
        for field in message.fields
        if field.datatype == PointField.FLOAT64 and field.count == 1
    }
    count, step = message.width * message.height, message.point_step
    if not offsets.keys() >= set(FIELDS):
        raise MessageError(f"a plan without its fields {', '.join(FIELDS)}")
    whole = max(offsets.values()) + np.dtype(float).itemsize <= step
    if not count or not whole or count * step != len(message.data):
        raise MessageError(f"a plan of {len(message.data)} bytes that should be {count * step}")
    number = ">f8" if message.is_bigendian else "<f8"
    kind = np.dtype(
        {
            "names": FIELDS,
            "formats": [number] * len(FIELDS),
            "offsets": [offsets[name] for name in FIELDS],
            "itemsize": step,
        }
    )
    rows = np.frombuffer(bytes(message.data), kind)
    times = rows["time"].astype(float)
    if not (np.isfinite(times).all() and (np.diff(times, prepend=0.0) > 0.0).all()):
        raise MessageError("a plan whose times do not increase from 0 on")
    stamp = message.header.stamp
    return PlanArrays(
        stamp_ns=stamp.sec * NANOSECONDS_PER_SECOND + stamp.nanosec,
        times=times,
        centres=np.stack([rows[axis].astype(float) for axis in "xyz"], axis=1),
        costs=rows["cost"].astype(float),
        alternatives=rows["alternative"].astype(float),
    )
