"""Small policies with random weights: valid for a character, and good for nothing."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from controller_node.parameters import make_gains, resolve_for
from controller_node.planner.compiled.network import Network
from controller_node.planner.compiled.observation import FRAME_VECTORS, ObservationScales
from controller_node.planner.policy.file import Policy, write_policy
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character

HIDDEN = (13, 7)  # not multiples of four
AHEAD = (0, 24, 72)  # ticks
UNIT = 0.05  # rad or m


def random_network(sizes: Sequence[int], rng: np.random.Generator) -> Network:
    """A network of so many inputs, twice hidden, and outputs; what a layer adds is about 1."""
    arrays: list[FloatArray] = []
    for inputs, outputs in pairwise(sizes):
        arrays.append(rng.normal(size=(inputs, outputs)) / np.sqrt(inputs))
        arrays.append(0.1 * rng.normal(size=outputs))
    return Network(*(array.astype(np.float32) for array in arrays))


def random_policy(
    character: Character, *, seed: int = 0, hold: int = 8, rate: int = 240, largest: float = 2.0
) -> Policy:
    """A policy for a character, the same of each seed; `hold` in ticks, `rate` in Hz."""
    rng, layout = np.random.default_rng(seed), character.layout
    parents = {link.parent for link in character.links}
    ends = 3 * len(set(range(len(character.links))) - parents)
    features, actions = 2 * layout.size + 3 + ends, layout.size - 6
    frame = FRAME_VECTORS + ends + actions
    scales = ObservationScales(
        rng.uniform(0.5, 1.5, features),
        rng.normal(size=(len(AHEAD), frame)),
        rng.uniform(0.5, 1.5, (len(AHEAD), frame)),
        2 * layout.size - 6,
    )
    inputs = features + len(AHEAD) * frame
    about = {
        "format": 1,
        "character": character.name,
        "dofs": list(layout.dof_names),
        "clips": ["walk"],
        "rate": rate,
        "hold": hold,
        "mass": character.mass,
        "gravity": 9.81,
        "calm": 0.5,
        "largest": largest,
        "trained": {},
        "figures": {},
    }
    return Policy(
        about,
        random_network((inputs, *HIDDEN, actions), rng),
        random_network((inputs, *HIDDEN, 1), rng),
        scales,
        np.array(AHEAD, dtype=np.intp),
        np.full(actions, UNIT),
        *(gains(character, rate)),
    )


def gains(character: Character, rate: int) -> tuple[FloatArray, FloatArray]:
    """The stiffness and damping (n,) that a character has by default."""
    found = make_gains(character, resolve_for(character, {"rate": rate}))
    return found.stiffness, found.damping


def write_random_policy(path: Path, character: Character, *, hold: int = 8, seed: int = 0) -> Path:
    """The file of a random policy."""
    write_policy(path, random_policy(character, hold=hold, seed=seed))
    return path
