"""The expectation of a plan as `sensor_msgs/PointCloud2`: the path of the centre of mass."""

import sys

import numpy as np

from controller_node.planner.outlook import Outlook
from msgs_config.frame_names import WORLD
from msgs_config.messages import topics, typed

FIELDS = ("x", "y", "z", "time", "cost", "alternative", "anchor_x", "anchor_y", "anchor_yaw")
"""Of each point: m; s after the state; costs; m and rad, where the reference's world is."""

_WIDTH = 8  # bytes of a double
_FIELD = "sensor_msgs/msg/PointField"


def plan_message(outlook: Outlook, stamp_ns: int) -> bytes:
    """The message, a point for each check; `stamp_ns` is of the state that the plan was made in."""
    count, anchor = len(outlook.times), outlook.anchor
    rows = np.empty((count, len(FIELDS)))
    rows[:, :3] = outlook.centres
    rows[:, 3], rows[:, 4], rows[:, 5] = outlook.times, outlook.costs, outlook.alternatives
    rows[:, 6:] = anchor.place.real, anchor.place.imag, anchor.yaw
    double = typed.constants(_FIELD).FLOAT64
    message = typed.stamped(
        topics.PLAN.type_name,
        stamp_ns,
        WORLD,
        height=1,
        width=count,
        is_dense=bool(np.isfinite(rows).all()),
        fields=[
            typed.new(_FIELD, name=name, offset=_WIDTH * index, datatype=double, count=1)
            for index, name in enumerate(FIELDS)
        ],
        is_bigendian=sys.byteorder == "big",
        point_step=_WIDTH * len(FIELDS),
        row_step=_WIDTH * len(FIELDS) * count,
        data=np.frombuffer(rows.tobytes(), np.uint8),
    )
    return typed.encode(message)
