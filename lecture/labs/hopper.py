"""A planar leg with a trunk, and the hop that it shall do."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from actuated_characters.batch.worlds import Batch
from lecture.labs.simulated import ENGINE, RATE, heavier
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character

FOOT = 3  # entries of the foot, which no motor drives: x, z, pitch; the joints follow
JOINTS = 3  # ankle, knee, hip
WINDOW = 16  # ticks, for which a target holds
_BODY = Path(__file__).parent / "bodies" / "hopper.yaml"
_PLANE = [0, 2]  # of x, y, z
# Time in s, the foot's x and z in m and its pitch, then ankle, knee and hip in rad.
_HOP = np.array(
    (
        (0.0, 0.0, 0.0, 0.0, 0.03, 0.0, 0.0),
        (0.2, 0.0, 0.0, 0.0, 0.03, 0.0, 0.0),
        (0.6, 0.0, 0.0, 0.0, 0.55, -1.2, 0.95),
        (0.75, 0.0, 0.0, 0.0, 0.55, -1.2, 0.95),
        (0.95, 0.0, 0.0, 0.0, 0.1, -0.1, 0.1),
        (1.1, 0.125, 0.1, 0.0, 0.2, -0.4, 0.3),
        (1.25, 0.25, 0.0, 0.0, 0.1, -0.2, 0.2),
        (1.5, 0.25, 0.0, 0.0, 0.5, -1.1, 0.9),
        (2.0, 0.25, 0.0, 0.0, 0.03, 0.0, 0.0),
        (2.4, 0.25, 0.0, 0.0, 0.03, 0.0, 0.0),
    )
)


class Errors(NamedTuple):
    """How far samples are from the reference, and how fast they move against it."""

    joints: FloatArray  # (s, 3), rad
    foot: FloatArray  # (s, 3), x and z in m, pitch in rad
    centre: FloatArray  # (s, 2), x and z of the centre of mass, m
    centre_velocity: FloatArray  # (s, 2), m/s

    def distances(self) -> FloatArray:
        """Of the centres of mass (s,), m."""
        found: FloatArray = np.sqrt(np.square(self.centre).sum(axis=1))
        return found


def hopper(factor: float = 1.0) -> Character:
    """The body, with so many times its mass."""
    return heavier(load_character(_BODY), factor)


def hop(speed: float) -> FloatArray:
    """The reference's positions (w + 1, 6), a window apart, at a speed, until it stands again.

    It has only sums and products, which no processor rounds otherwise.
    """
    count = int(_HOP[-1, 0] / speed * RATE) // WINDOW
    times = speed * WINDOW / RATE * np.arange(count + 1)
    row = np.minimum(np.searchsorted(_HOP[:, 0], times, side="right"), len(_HOP) - 1)
    before, after = _HOP[row - 1], _HOP[row]
    share = (times - before[:, 0]) / (after[:, 0] - before[:, 0])
    smooth = share * share * (3.0 - 2.0 * share)
    found: FloatArray = before[:, 1:] + smooth[:, np.newaxis] * (after - before)[:, 1:]
    return found


def worlds(character: Character, count: int, hash_states: bool = False) -> Batch:
    """So many of the body, whose actions are targets of `advance`."""
    return Batch(character, count, action="angles", hash_states=hash_states, simulator=dict(ENGINE))


def advance(batch: Batch, begins: IntArray, targets: FloatArray) -> None:
    """A window, in which worlds go on from the states of some worlds (s,) with targets (s, 3).

    Each begins anew, which clears what the engine remembers of contacts: so the same targets lead
    from the same state to the same one in whichever world.
    """
    batch.reset(position=batch.position[begins], velocity=batch.velocity[begins])
    batch.step(np.hstack((np.zeros((len(batch), FOOT)), targets)), ticks=WINDOW)


def errors(
    model: DynamicsModel,
    position: FloatArray,
    velocity: FloatArray,
    desired: FloatArray,
    desired_velocity: FloatArray,
) -> Errors:
    """Of states (s, 6) against one of the reference (6,)."""
    centre, centre_velocity = _centre(model, desired, desired_velocity)
    off = position - desired
    centres = np.array([_centre(model, *each) for each in zip(position, velocity, strict=True)])
    return Errors(
        off[:, FOOT:], off[:, :FOOT], centres[:, 0] - centre, centres[:, 1] - centre_velocity
    )


def _centre(
    model: DynamicsModel, position: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The centre of mass (2,), and its velocity (2,)."""
    model.update(position, velocity)
    return model.centre_of_mass()[_PLANE].copy(), model.centre_of_mass_velocity()[_PLANE].copy()
