"""Episodes in the planner's world, decision after decision, without Python in between."""

import math

import numpy as np

from actuated_characters.training.decorator import compiled
from actuated_characters.training.episode_types import (
    CUT,
    FELL,
    Draws,
    Episode,
    Rules,
    Table,
    Trace,
    World,
)
from actuated_characters.training.rewards import cost_of, is_lost, reward_of
from controller_node.planner.compiled import rollout
from controller_node.planner.compiled.anchoring import SOON, advance_anchor
from controller_node.planner.compiled.law import Joints
from controller_node.planner.compiled.network import Network, evaluate
from controller_node.planner.compiled.observation import find_deviation, observe
from msgs_config.arrays import FloatArray, SingleArray
from msgs_config.compiled import mujoco_functions as mj
from msgs_config.compiled.borrowed import borrow
from msgs_config.compiled.rotations import axes, product, quaternion, yaw_of

_advance_anchor = compiled(advance_anchor)

_PUSH_S = (0.1, 0.2)  # how long pushes last
_OFF_TURN = 0.03  # of quaternions' entries, an episode's first state is off, standard deviation
_OFF_SPEED, _OFF_SPIN = 0.15, 0.4  # m/s and rad/s, the same of velocities


@compiled
def run_decisions(
    episode: Episode,
    trace: Trace,
    network: Network,
    spread: float,
    draws: Draws,
    push_share: float,
    most_push: float,
    table: Table,
    rules: Rules,
    world: World,
) -> None:
    """Fill a trace from where an episode stands; where one ends another one begins.

    Args:
        episode: It goes on from there the next time.
        trace: The result.
        network: Policy.
        spread: Standard deviation of what is added to its actions.
        draws: What is random.
        push_share: Of decisions in which a push begins.
        most_push: N s.
        table: References.
        rules: What all episodes have in common.
        world: What simulates it.
    """
    table, rules, world = borrow(table), borrow(rules), borrow(world)
    trace, network = borrow(trace), borrow(network)
    size = table.features.shape[1]
    features, deviation = np.empty(size), np.empty(size)
    frames = np.empty((len(table.ahead), table.frames.shape[1]))
    action = np.empty(len(rules.unit), np.float32)
    _enter(episode, features, deviation, table, rules, world)
    for t in range(len(trace.rewards)):
        trace.rows[t] = episode.counts[0]
        _tell(trace.observations[t], episode.counts[0], deviation, frames, table, rules)
        evaluate(network, trace.observations[t], action)
        for i in range(len(action)):
            action[i] += np.float32(spread) * draws.noise[t, i]
        trace.actions[t] = action
        _draw_push(episode, draws.push[t], push_share, most_push, rules.period)
        went_well = _hold(action, episode, table, rules, world)
        episode.counts[0] += rules.hold
        episode.counts[1] += 1
        cost = math.inf
        if went_well:
            cost = _look(episode, features, deviation, table, rules, world)
            went_well = not is_lost(deviation, rules.scales.centre)
        trace.costs[t] = cost
        trace.rewards[t] = reward_of(cost, _gives_way(episode, rules), action) if went_well else 0.0
        trace.ends[t] = 0 if went_well else FELL
        _tell(trace.after[t], episode.counts[0], deviation, frames, table, rules)
        if went_well and episode.counts[0] + rules.hold >= table.ends[episode.counts[0]]:
            trace.ends[t] = CUT
        if trace.ends[t]:
            trace.lengths[t] = episode.counts[1]
            row, noise = draws.starts[t], draws.start_noise[t]
            begin(episode, row, noise, table, world.body.joints)
            _enter(episode, features, deviation, table, rules, world)
    episode.position[:] = world.engine.position
    episode.velocity[:] = world.engine.velocity


@compiled
def begin(episode: Episode, row: int, noise: FloatArray, table: Table, joints: Joints) -> None:
    """Begin an episode at a row of the reference, by so many standard deviations (n,) off."""
    episode.position[:] = table.positions[row]
    episode.velocity[:] = table.velocities[row]
    n = len(episode.velocity)
    for i in range(7, len(episode.position)):
        episode.position[i] += _OFF_TURN * noise[i % n]
    for start in joints.ball_positions:
        turn = episode.position[start : start + 4]
        turn /= math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2 + turn[3] ** 2)
    for i in range(n):
        episode.velocity[i] += (_OFF_SPEED if i < 3 else _OFF_SPIN) * noise[i]
    episode.counts[0], episode.counts[1] = row, 0
    episode.anchor[:] = 0.0
    episode.push[:] = 0.0


@compiled
def _enter(
    episode: Episode,
    features: FloatArray,
    deviation: FloatArray,
    table: Table,
    rules: Rules,
    world: World,
) -> None:
    """Put the world into an episode's state, and watch it."""
    rollout.begin(episode.position, episode.velocity, world.engine)
    mj.step_before_forces(world.engine.model, world.engine.data)
    _watch(episode.counts[0], features, deviation, table, rules, world)


@compiled
def _watch(
    row: int,
    features: FloatArray,
    deviation: FloatArray,
    table: Table,
    rules: Rules,
    world: World,
) -> None:
    """Write features (f,) of the world's state, and their deviation from those of a row."""
    rollout.write_check(features, table.positions[row], world.body, world.engine)
    wanted, facing = table.features[row], table.facing[row]
    find_deviation(deviation, features, wanted, facing, rules.scales.centre)


@compiled
def _tell(
    observation: SingleArray,
    row: int,
    deviation: FloatArray,
    frames: FloatArray,
    table: Table,
    rules: Rules,
) -> None:
    """Write an observation; `frames` is room."""
    for k in range(len(table.ahead)):
        frames[k] = table.frames[min(row + table.ahead[k], table.ends[row])]
    observe(observation, deviation, frames, table.facing[row], rules.scales)


@compiled
def _draw_push(
    episode: Episode, draws: FloatArray, share: float, most: float, period: float
) -> None:
    """Begin a push now and then, at the root and from any side."""
    if episode.push[2] > 0.0 or draws[0] >= share:
        return
    angle, impulse = 2.0 * math.pi * draws[1], most * draws[2]
    ticks = math.ceil((_PUSH_S[0] + (_PUSH_S[1] - _PUSH_S[0]) * draws[3]) / period)
    episode.push[0] = impulse * math.cos(angle) / (ticks * period)
    episode.push[1] = impulse * math.sin(angle) / (ticks * period)
    episode.push[2] = ticks


@compiled
def _hold(action: SingleArray, episode: Episode, table: Table, rules: Rules, world: World) -> bool:
    """Simulate the ticks of a decision; whether that went well."""
    engine, room, row = world.engine, world.room, episode.counts[0]
    for tick in range(rules.hold):
        room.error[:6] = 0.0
        for i in range(len(action)):
            room.error[6 + i] = rules.unit[i] * min(max(action[i], -rules.largest), rules.largest)
        target, velocity = table.positions[row + tick + 1], table.velocities[row + tick + 1]
        rollout.apply_law(target, velocity, world.body, engine, room, world.bounds)
        engine.applied[:] *= episode.strength
        if episode.push[2] > 0.0:
            engine.applied[0] += episode.push[0]
            engine.applied[1] += episode.push[1]
            episode.push[2] -= 1.0
        if not rollout.is_bounded(engine):
            return False
        rollout.step_with_forces(world.body, engine)
        mj.step_before_forces(engine.model, engine.data)
    return True


@compiled
def _look(
    episode: Episode,
    features: FloatArray,
    deviation: FloatArray,
    table: Table,
    rules: Rules,
    world: World,
) -> float:
    """Watch the world, let the reference give way, and tell what the state costs."""
    row = episode.counts[0]
    _watch(row, features, deviation, table, rules, world)
    if rules.gives_way and _move_reference(episode, features, table, rules, world):
        _watch(row, features, deviation, table, rules, world)
    return cost_of(deviation, _gives_way(episode, rules), rules)


@compiled
def _gives_way(episode: Episode, rules: Rules) -> bool:
    """Whether the character is perturbed: see `Anchor.is_perturbed`."""
    return bool(episode.counts[1] * rules.hold * rules.period < episode.anchor[3])


@compiled
def _move_reference(
    episode: Episode, features: FloatArray, table: Table, rules: Rules, world: World
) -> bool:
    """Move the reference's world as `Anchor` does; whether it moved.

    Here the character is moved in that world instead, which is the same: the ground is even.
    """
    row, anchor, engine = episode.counts[0], episode.anchor, world.engine
    c, wanted = rules.scales.centre, table.features[row]
    soon = table.features[min(row + round(SOON / rules.period), table.ends[row])]
    root, wanted_root = quaternion(engine.position, 3), quaternion(table.positions[row], 3)
    x, y, z, w = wanted_root
    spin, up = table.velocities[row, 3:6], axes(wanted_root)[2]
    place, yaw, anchor[3], anchor[4] = _advance_anchor(
        complex(anchor[0], anchor[1]),
        anchor[2],
        anchor[3],
        anchor[4],
        complex(features[c], features[c + 1]),
        complex(features[c + 3], features[c + 4]),
        yaw_of(product(root, (-x, -y, -z, w))),
        complex(wanted[c], wanted[c + 1]),
        complex(wanted[c + 3], wanted[c + 4]),
        complex(soon[c + 3], soon[c + 4]),
        up[0] * spin[0] + up[1] * spin[1] + up[2] * spin[2],
        episode.counts[1] * rules.hold * rules.period,
        rules.hold * rules.period,
    )
    before, turned = complex(anchor[0], anchor[1]), anchor[2] - yaw
    if place == before and turned == 0.0:
        return False
    by = complex(math.cos(turned), math.sin(turned))
    at, moves = complex(engine.position[0], engine.position[1]), engine.velocity
    at = by * at + complex(math.cos(yaw), -math.sin(yaw)) * (before - place)
    move = by * complex(moves[0], moves[1])
    root = product((0.0, 0.0, math.sin(0.5 * turned), math.cos(0.5 * turned)), root)
    engine.position[0], engine.position[1] = at.real, at.imag
    engine.position[3], engine.position[4] = root[3], root[0]
    engine.position[5], engine.position[6] = root[1], root[2]
    moves[0], moves[1] = move.real, move.imag
    anchor[0], anchor[1], anchor[2] = place.real, place.imag, yaw
    mj.step_before_forces(engine.model, engine.data)
    return True
