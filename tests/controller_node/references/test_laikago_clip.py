"""The quadruped's captured walk: where PyBullet has the toes of the model that it was made for."""

import json
from collections.abc import Iterator

import numpy as np
import pybullet_data
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.clips.reading import available_clips, read_clip
from msgs_config.geometry import rotations
from tests.support.engines import pybullet
from tests.support.physics import character

LAIKAGO = character("laikago")
TOES = ["toeFR", "toeFL", "toeRR", "toeRL"]  # the file's order of the legs
UPPER_LEG, KNEE = -0.6, 0.66  # rad, from a motor's angle to the joint's
OUTWARDS = [-1.0, 1.0, -1.0, 1.0]  # of the hip's motor
RADIUS = 0.03  # m, of a toe


@pytest.fixture(scope="module")
def toes() -> FloatArray:
    """Where the toes (frames, 4, 3) of the walk are, m, by this project's character."""
    frames, model = read_clip(LAIKAGO, "walk"), DynamicsModel(LAIKAGO)
    names = [link.name for link in LAIKAGO.links]
    links = np.array([names.index(toe) for toe in TOES])
    positions = frames.positions.copy()
    positions[:, 3:6] = rotations.log(frames.orientations_xyzw[:, 0])
    found = []
    for position in positions:
        model.update(position, np.zeros(LAIKAGO.layout.size))
        found.append(model.link_frames(links)[0])
    return np.array(found)


@pytest.fixture
def playback() -> Iterator[FloatArray]:
    """The same, by PyBullet's own forward kinematics of the variant that is y-up."""
    client = pybullet.connect(pybullet.DIRECT)
    folder = pybullet_data.getDataPath()
    body = pybullet.loadURDF(
        f"{folder}/laikago/laikago_toes.urdf", useFixedBase=True, physicsClientId=client
    )
    joints = range(pybullet.getNumJoints(body, physicsClientId=client))
    infos = [pybullet.getJointInfo(body, joint, physicsClientId=client) for joint in joints]
    links = [info[0] for toe in TOES for info in infos if info[12].decode() == toe]
    hinges = [info[0] for info in infos if info[2] == pybullet.JOINT_REVOLUTE]
    with open(f"{folder}/data/motions/laikago_walk.txt", encoding="utf-8") as file:
        frames = np.array(json.load(file)["Frames"])
    found = []
    for frame in frames:
        legs = frame[8:].reshape(4, 3) + np.array([0.0, UPPER_LEG, KNEE])
        legs[:, 0] *= OUTWARDS
        pybullet.resetBasePositionAndOrientation(
            body, frame[1:4], frame[4:8], physicsClientId=client
        )
        for hinge, angle in zip(hinges, legs.ravel(), strict=True):
            pybullet.resetJointState(body, hinge, angle, physicsClientId=client)
        states = pybullet.getLinkStates(
            body, links, computeForwardKinematics=True, physicsClientId=client
        )
        found.append([state[4] for state in states])
    yield np.array(found)
    pybullet.disconnect(client)


def test_it_is_the_motion_that_pybullet_plays(toes: FloatArray, playback: FloatArray) -> None:
    assert available_clips(LAIKAGO) == ["walk"]
    np.testing.assert_allclose(toes, playback, atol=2e-5)


def test_the_toes_step_on_the_ground_two_by_two(toes: FloatArray) -> None:
    heights = toes[..., 2]
    lowest = np.sort(heights, axis=1)

    assert np.abs(lowest[:, 0] - RADIUS).max() < 0.016  # they sink a little
    assert np.abs(lowest[:, 1] - lowest[:, 0]).max() < 0.008
    assert heights.max() > 0.08
    across = np.corrcoef(heights.T)  # a trot: right front with left rear
    assert min(across[0, 3], across[1, 2]) > 0.95 > 0.0 > max(across[0, 1], across[2, 3])


def test_it_walks_where_it_faces_within_its_bounds() -> None:
    frames = read_clip(LAIKAGO, "walk")
    way = frames.positions[-1, :2] - frames.positions[0, :2]
    forwards = rotations.rotate(frames.orientations_xyzw[0, 0], np.array([1.0, 0.0, 0.0]))

    assert frames.wraps and not frames.clamped
    assert float(way @ forwards[:2]) > 0.99 * float(np.linalg.norm(way)) > 0.3
    upright = rotations.rotate(frames.orientations_xyzw[:, 0], np.array([0.0, 0.0, 1.0]))
    assert upright[:, 2].min() > 0.99
