"""Draws a character from `robot_description` and `/tf` alone, as a viewer does.

`python -m tests.support.description_picture FILE.png` draws a walking humanoid so, below the
renderer's own pictures of the same states.
"""

import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import rclpy
from matplotlib.image import imsave
from rclpy.context import Context
from urdf_parser_py import urdf

from actuated_characters.render.engine.camera_pose import CameraPose, Size
from actuated_characters.render.engine.renderer import FrameSpec, Picture, Renderer
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.character.loading import load_character
from msgs_config.geometry import rotations
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from tests.support.description import origin_matrix, parse
from tests.support.engines import Engine, pybullet
from tests.support.ros import SimulatorClient
from tests.support.transforms import TF2, Frames, environment_with_tf2

PROJECT = Path(__file__).parents[2]
TICKS = (60, 130, 200, 270)  # of a walk, at 240 Hz
SIZE = (260, 400)


def draw_description(
    robot: urdf.Robot, frames: Mapping[str, FloatArray], view: CameraPose, size: Size
) -> tuple[Picture, BoolArray]:
    """A picture (h, w, 3) of a description's visual shapes, and where (h, w) one is seen.

    `frames` are homogeneous matrices (4, 4) of the links in the world, by name.
    """
    client = Engine()
    try:
        for link in robot.links:
            for visual in link.visuals:
                if getattr(visual.geometry, "radius", 1.0) == 0.0:  # there is nothing to see
                    continue
                _place(client, robot, visual, frames[link.name] @ origin_matrix(visual.origin))
        return _take(client, view, size)
    finally:
        client.close()


def _place(client: Engine, robot: urdf.Robot, visual: urdf.Visual, pose: FloatArray) -> None:
    """Put one shape where it is, in its colour."""
    colors = {material.name: material.color for material in robot.materials}
    material = visual.material
    color = material and (material.color or colors.get(material.name))
    shape = pybullet.createVisualShape(
        **_geometry(visual.geometry),
        rgbaColor=color.rgba if color else (0.7, 0.7, 0.7, 1.0),
        physicsClientId=client,
    )
    turn = rotations.exp(_rotation_vector(pose[:3, :3]))
    pybullet.createMultiBody(
        baseVisualShapeIndex=shape,
        basePosition=pose[:3, 3].tolist(),
        baseOrientation=turn.tolist(),
        physicsClientId=client,
    )


def _geometry(geometry: object) -> dict[str, object]:
    if isinstance(geometry, urdf.Box):
        return {"shapeType": pybullet.GEOM_BOX, "halfExtents": [0.5 * e for e in geometry.size]}
    if isinstance(geometry, urdf.Sphere):
        return {"shapeType": pybullet.GEOM_SPHERE, "radius": geometry.radius}
    if isinstance(geometry, urdf.Cylinder):
        return {
            "shapeType": pybullet.GEOM_CYLINDER,
            "radius": geometry.radius,
            "length": geometry.length,
        }
    assert isinstance(geometry, urdf.Mesh)
    return {
        "shapeType": pybullet.GEOM_MESH,
        "fileName": unquote(urlsplit(geometry.filename).path),
        "meshScale": geometry.scale or [1.0, 1.0, 1.0],
    }


def _rotation_vector(matrix: FloatArray) -> FloatArray:
    """The rotation vector (3,) of a matrix; near a half turn from the symmetric part."""
    angle = float(np.arccos(np.clip(0.5 * (np.trace(matrix) - 1.0), -1.0, 1.0)))
    skew = matrix - matrix.T
    axis = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    if np.linalg.norm(axis) < 1e-6 and angle > 1.0:
        axis = np.linalg.eigh(matrix + matrix.T)[1][:, -1]
    length = float(np.linalg.norm(axis))
    scaled: FloatArray = axis * (angle / length) if length > 0.0 else axis
    return scaled


def _take(client: Engine, view: CameraPose, size: Size) -> tuple[Picture, BoolArray]:
    right_up_back = view.axes()
    eye = np.array(view.target) + view.distance * right_up_back[2]
    width, height = size
    near = 0.1
    step = view.pixel(height) * near
    _, _, rgba, _, seen = pybullet.getCameraImage(
        width,
        height,
        pybullet.computeViewMatrix(eye.tolist(), view.target, right_up_back[1].tolist()),
        pybullet.computeProjectionMatrix(  # PyBullet's samples are in the corners of pixels
            step * (0.5 - 0.5 * width),
            step * (0.5 + 0.5 * width),
            step * (0.5 - 0.5 * height),
            step * (0.5 + 0.5 * height),
            near,
            100.0,
        ),
        shadow=False,
        renderer=pybullet.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    picture = np.array(rgba, np.uint8).reshape(height, width, 4)[..., :3]
    return picture, np.array(seen).reshape(height, width) >= 0


def draw_position(
    name: str, position: FloatArray, view: CameraPose, size: Size
) -> tuple[Picture, BoolArray]:
    """The renderer's picture of a character at a position (n,), and where (h, w) it is seen."""
    renderer = Renderer(load_character(name), ground=False, samples=1)
    picture = renderer.picture(FrameSpec(position, view=view), size)
    return picture, (picture != picture[0, 0]).any(axis=2)


def view_at(origin: Sequence[float]) -> CameraPose:
    """A view of a person whose pelvis is there."""
    return CameraPose((origin[0], origin[1], 0.9), distance=4.5, yaw=0.5, pitch=0.15)


def main(file: str) -> None:
    """Let the humanoid walk, and draw what its topics say."""
    sys.path.insert(0, str(TF2))
    context = Context()
    rclpy.init(context=context)
    client = SimulatorClient(context)
    frames = Frames(client.node)
    descriptions = client.listen(topics.ROBOT_DESCRIPTION)
    config = str(PROJECT / "config" / "humanoid_walk.yaml")
    parameters = ("display_rate:=240.0", f"max_ticks:={max(TICKS)}", "wait_for_subscribers:=2")
    given = [part for each in parameters for part in ("-p", f"sim_node:{each}")]
    with tempfile.TemporaryDirectory() as folder:
        command = (sys.executable, "-m", "actuated_characters.composed.main")
        process = subprocess.Popen(
            [*command, "--ros-args", "--params-file", config, *given],
            env=environment_with_tf2(),
            cwd=folder,
        )
        try:
            stamps = [TickClock(240).stamp_ns(tick) for tick in TICKS]
            client.spin_until(lambda: set(stamps) <= frames.moving.keys(), "frames of a walk")
            client.spin_until(lambda: descriptions.messages, "the description")
            states = [client.state(tick) for tick in TICKS]
        finally:
            process.terminate()
            process.wait(20.0)
    robot, rows = parse(descriptions.last.data), [[], []]
    for stamp, state in zip(stamps, states, strict=True):
        view = view_at(state.position)
        placed = {link.name: frames.in_frame(link.name, "world", stamp) for link in robot.links}
        own, mask = draw_description(robot, placed, view, SIZE)
        theirs, other = draw_position("humanoid", np.array(state.position), view, SIZE)
        share = np.count_nonzero(mask != other) / np.count_nonzero(other)
        print(f"{1e-9 * stamp:.3f} s: {100 * share:.2f} % of the outline's pixels differ")
        rows[0].append(theirs)
        rows[1].append(own)
    imsave(file, np.concatenate([np.concatenate(row, axis=1) for row in rows]))
    client.close()
    rclpy.shutdown(context=context)


if __name__ == "__main__":
    main(sys.argv[1])
