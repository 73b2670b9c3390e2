"""Decodes a planner's messages on `~/plan`."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from controller_node.interface.plan_message import FIELDS
from msgs_config.arrays import FloatArray
from msgs_config.errors import MessageError
from msgs_config.messages import topics, typed


@dataclass(frozen=True, slots=True)
class PlanArrays:
    """The expectations of a plan, at each of its c checks."""

    stamp_ns: int  # stamp of the state in which the plan was made
    times: FloatArray  # (c,) s after that state
    centres: FloatArray  # (c, 3) m, centres of mass in the world
    costs: FloatArray  # (c,) parts of the plan's cost, which is their sum
    alternatives: FloatArray  # (c,) parts of the cost of the best other plan that was tried


def decode_plan(raw: bytes) -> PlanArrays:
    """Decode a plan from its serialised message.

    Raises:
        MessageError: the bytes are no PointCloud2, or one without a plan's fields.
    """
    message = typed.decode(raw, topics.PLAN.type_name)
    double = typed.constants("sensor_msgs/msg/PointField").FLOAT64
    fields = {
        str(field.name): field.offset
        for field in message.fields
        if field.datatype == double and field.count == 1
    }
    if not fields.keys() >= set(FIELDS):
        raise MessageError(f"a plan without its fields {', '.join(FIELDS)}")
    count, step, data = message.width * message.height, message.point_step, bytes(message.data)
    if not count or max(fields.values()) + 8 > step or count * step != len(data):
        raise MessageError(f"a plan of {len(data)} bytes that should be {count * step}")
    number = ">f8" if message.is_bigendian else "<f8"
    shape = np.dtype(
        {
            "names": list(fields),
            "formats": [number] * len(fields),
            "offsets": list(fields.values()),
            "itemsize": step,
        }
    )
    points: Any = np.frombuffer(data, shape)
    times, *centre, costs, alternatives = (
        points[name].astype(float) for name in ("time", "x", "y", "z", "cost", "alternative")
    )
    if not (np.isfinite(times).all() and times[0] >= 0.0 and (np.diff(times) > 0.0).all()):
        raise MessageError("a plan whose times do not increase from 0 on")
    return PlanArrays(typed.stamp_of(message), times, np.stack(centre, axis=1), costs, alternatives)
