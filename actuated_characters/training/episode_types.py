"""What episodes are made of: references, rules, worlds, where they stand, and what happened."""

from typing import NamedTuple

from controller_node.planner.compiled.law import Room
from controller_node.planner.compiled.observation import ObservationScales
from controller_node.planner.compiled.rollout import EngineBuffers, RolloutModel
from msgs_config.arrays import FloatArray, IntArray, SingleArray
from msgs_config.compiled.soft_limits import PassedBounds

FELL, CUT = 1, 2  # how an episode ends: it is lost, or its reference is over


class Table(NamedTuple):
    """References, one after the other, a row a tick."""

    positions: FloatArray  # (r, q) MuJoCo's
    velocities: FloatArray  # (r, n)
    features: FloatArray  # (r, f)
    frames: FloatArray  # (r, d)
    facing: FloatArray  # (r,) rad
    ends: IntArray  # (r,) last row of the same reference
    ahead: IntArray  # (k,) rows from now to the frames that are told


class Rules(NamedTuple):
    """What all episodes have in common."""

    hold: int  # ticks of a decision
    period: float  # s, of a tick
    unit: FloatArray  # (a,) rad or m, offset of an action of one
    largest: float  # action
    weights: FloatArray  # (f,) of deviations
    loose: FloatArray  # (f,) the same while the reference gives way
    feet: IntArray  # where feet begin among features
    hands: IntArray  # where hands begin
    gives_way: bool  # whether the reference's world moves after a character that is pushed off
    scales: ObservationScales


class World(NamedTuple):
    """What one thread simulates a kind of world with."""

    body: RolloutModel
    engine: EngineBuffers
    bounds: PassedBounds
    room: Room


class Episode(NamedTuple):
    """Where an episode stands between two calls."""

    position: FloatArray  # (q,) in the reference's world, as the velocity
    velocity: FloatArray  # (n,)
    counts: IntArray  # (2,) row of the reference, decisions since it began
    anchor: FloatArray  # (5,) place (x, y), yaw, calm from, settled from: see `Anchor`
    push: FloatArray  # (3,) N, N, ticks that are left of it
    strength: float  # by which efforts are larger than the law's; that of a lighter body


class Draws(NamedTuple):
    """What is random, for each decision."""

    noise: SingleArray  # (t, a) standard deviations of actions
    starts: IntArray  # (t,) rows
    start_noise: FloatArray  # (t, n) standard deviations
    push: FloatArray  # (t, 4) 0 to 1: whether, from where, how strong, how long


class Taught(NamedTuple):
    """What teachers say to decisions, and how much that counts against what was tried."""

    actions: SingleArray  # (m, a)
    shares: SingleArray  # (m,) 0 to 1; 0 where there is no teacher


class Trace(NamedTuple):
    """What happened, for each decision."""

    observations: SingleArray  # (t, o)
    after: SingleArray  # (t, o) what followed, before another episode begins
    actions: SingleArray  # (t, a)
    rewards: FloatArray  # (t,)
    costs: FloatArray  # (t,)
    ends: IntArray  # (t,) 0, FELL or CUT
    lengths: IntArray  # (t,) decisions of an episode that ended
    rows: IntArray  # (t,) of the table, in which it was decided
