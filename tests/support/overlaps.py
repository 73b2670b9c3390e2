"""How deep a character's shapes overlap while it moves, as PyBullet finds it."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from tests.support.engines import Engine, load_urdf, pybullet


def depths(character: Character, motion: GeneralizedPosition) -> dict[str, NDArray[np.float64]]:
    """Depth (f,) in m by `one-other`, of links that do not hang on each other; below 0 if apart."""
    shaped = [row for row, link in enumerate(character.links) if link.collision_shapes]
    above = [_line(character, row) for row in range(len(character.links))]
    pairs = [
        (one, other)
        for one, other in combinations(shaped, 2)
        if one not in above[other] and other not in above[one]
    ]
    client = Engine()
    try:
        body = load_urdf(client, character.loading)
        numbers = {pybullet.getBodyInfo(body, physicsClientId=client)[0].decode(): -1}
        joints = {}
        for number in range(pybullet.getNumJoints(body, physicsClientId=client)):
            info = pybullet.getJointInfo(body, number, physicsClientId=client)
            numbers[info[12].decode()], joints[info[1].decode()] = number, number
        found = np.full((len(motion.position), len(pairs)), -np.inf)
        for frame in range(len(found)):
            _pose(client, body, joints, character, motion, frame)
            for column, pair in enumerate(pairs):
                one, other = (numbers[character.links[row].name] for row in pair)
                near = pybullet.getClosestPoints(
                    body, body, 0.2, one, other, physicsClientId=client
                )
                found[frame, column] = max((-point[8] for point in near), default=-0.2)
    finally:
        client.close()
    names = [link.name for link in character.links]
    return {f"{names[a]}-{names[b]}": found[:, k] for k, (a, b) in enumerate(pairs)}


def _pose(
    client: int,
    body: int,
    joints: dict[str, int],
    character: Character,
    motion: GeneralizedPosition,
    frame: int,
) -> None:
    position, turns = motion.position[frame], motion.orientations_xyzw[frame]
    inertial = character.links[0].inertial_pose
    centre = position[:3] + rotations.rotate(turns[0], np.array(inertial.position))
    whole = rotations.multiply(turns[0], np.array(inertial.orientation_xyzw))
    pybullet.resetBasePositionAndOrientation(
        body, centre.tolist(), whole.tolist(), physicsClientId=client
    )
    ball = 1
    for joint in character.layout.joints[1:]:
        number = joints[joint.name]
        if joint.rotation is None:
            angle = float(position[joint.start])
            pybullet.resetJointState(body, number, angle, physicsClientId=client)
        else:
            turn = turns[ball].tolist()
            pybullet.resetJointStateMultiDof(body, number, turn, physicsClientId=client)
            ball += 1


def _line(character: Character, row: int) -> set[int]:
    line = set()
    while row >= 0:
        line.add(row)
        row = character.links[row].parent
    return line
