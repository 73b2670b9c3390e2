"""The expectation of a plan as `sensor_msgs/PointCloud2`: the path of the centre of mass."""

import sys

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

from controller_node.planner.outlook import Outlook
from msgs_config.frame_names import WORLD
from msgs_config.messages.cdr import split_stamp

FIELDS = ("x", "y", "z", "time", "cost", "alternative", "anchor_x", "anchor_y", "anchor_yaw")
"""Of each point: m; s after the state; costs; m and rad, where the reference's world is."""

_WIDTH = 8  # bytes


def plan_message(outlook: Outlook, stamp_ns: int) -> PointCloud2:
    """One point for each check of a plan; `stamp_ns` is of the first state in which it acts."""
    count, anchor = len(outlook.times), outlook.anchor
    rows = np.empty((count, len(FIELDS)))
    rows[:, :3] = outlook.centres
    rows[:, 3], rows[:, 4], rows[:, 5] = outlook.times, outlook.costs, outlook.alternatives
    rows[:, 6:] = anchor.place.real, anchor.place.imag, anchor.yaw
    message = PointCloud2(height=1, width=count, is_dense=bool(np.isfinite(rows).all()))
    message.header.frame_id = WORLD
    message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(stamp_ns)
    message.fields = [
        PointField(name=name, offset=_WIDTH * index, datatype=PointField.FLOAT64, count=1)
        for index, name in enumerate(FIELDS)
    ]
    message.is_bigendian = sys.byteorder == "big"
    message.point_step = _WIDTH * len(FIELDS)
    message.row_step = message.point_step * count
    message.data = rows.tobytes()
    return message
