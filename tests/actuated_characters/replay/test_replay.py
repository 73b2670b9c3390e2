"""A replay finds what is not as it was, names it, and takes nothing else for a difference."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from actuated_characters.bags.recording import (
    CommandArrays,
    RecordedWorld,
    Recording,
    read_recordings,
)
from actuated_characters.bags.writer import BagWriter
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.replay.comparison import Difference
from actuated_characters.replay.effort_check import check_commands
from actuated_characters.replay.replay import replay, tick_count
from actuated_characters.replay.world import cut_world, read_world
from msgs_config.errors import RecordingError
from msgs_config.messages import configuration
from msgs_config.messages.wrenches import WrenchArrays
from msgs_config.versions import installed_versions
from sim_node.simulation_factory import make_simulation_settings
from tests.support.bags import (
    CONFIGURATION,
    Made,
    add_to,
    make_run,
    raw_configuration,
    raw_states,
    write_bag,
)
from tests.support.recordings import changed, commanding, recording_of, with_parameters

WALK = {"reference": "clip", "clip": "walk"}
TICKS = 48


@pytest.fixture(scope="module")
def made() -> Made:
    return make_run("humanoid", TICKS / 240.0, WALK)


@pytest.fixture(scope="module")
def walk(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A walk with the commands that led to it, and with no pushes."""
    return recording_of(made, tmp_path_factory.mktemp("walk"))


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return recording_of(make_run("pendulum", 0.1), tmp_path_factory.mktemp("pendulum"))


def difference_of(recording: Recording) -> Difference | None:
    return check_commands(recording).difference


# States


def test_a_run_comes_again(walk: Recording, made: Made) -> None:
    expected = StateHash()
    for state in made.states:
        expected.add(state)

    result = replay([walk])

    assert result.difference is None and result.remarks == ()
    assert (result.states, result.episodes) == (TICKS + 1, 1)
    assert result.state_hashes == {"": expected.hexdigest()}


def test_progress_reaches_the_number_of_ticks(walk: Recording) -> None:
    done: list[int] = []

    replay([walk], progress=done.append)

    assert done[-1] == tick_count([walk]) == TICKS


@pytest.mark.parametrize("quantity", ["position", "velocity"])
@pytest.mark.parametrize("row", [0, 17, TICKS])
def test_one_bit_of_a_state_is_found(walk: Recording, quantity: str, row: int) -> None:
    index = walk.layout.dof_names.index("left_hip_y")
    other = changed(getattr(walk, quantity), row, index)

    difference = replay([replace(walk, **{quantity: other})]).difference

    assert difference is not None
    assert (difference.tick, difference.stamp_ns) == (row + 1, walk.stamps_ns[row])
    assert (difference.quantity, difference.name) == (quantity, "left_hip_y")
    assert difference.recorded == other[row, index]
    assert difference.found == getattr(walk, quantity)[row, index]
    assert f"tick {row + 1}" in str(difference) and repr(difference.recorded) in str(difference)


@pytest.mark.parametrize(
    ("entry", "change", "reason"),
    [("right_knee", 1.0, ""), ("chest_x", np.inf, "the replay diverged at tick 22")],
)
def test_an_effort_that_was_another_one_changes_the_states(
    walk: Recording, entry: str, change: float, reason: str
) -> None:
    effort = walk.effort.copy()
    effort[20, walk.layout.dof_names.index(entry)] += change

    result = replay([replace(walk, effort=effort, commands=((),) * (TICKS + 1))])

    assert result.difference is not None and result.difference.tick == 22
    assert reason in str(result.difference)
    assert any("no commands" in note for note in result.remarks)


def test_contacts_are_compared_where_they_were_recorded(walk: Recording) -> None:
    touched = [WrenchArrays.of_rows(int(s), [], [], []) for s in walk.stamps_ns[1:]]
    false = WrenchArrays.of_rows(int(walk.stamps_ns[6]), ["chest"], [(1.0,) * 6], [])
    contacts = [*touched[:5], false, *touched[6:]]

    difference = replay([replace(walk, contacts=tuple(contacts))]).difference

    assert difference is not None and difference.quantity == "contact"
    assert difference.tick <= 7 and "number of contacts" in str(difference)


# Tolerance


def test_within_a_tolerance_the_largest_differences_are_told(walk: Recording) -> None:
    velocity = walk.velocity.copy()
    velocity[30, walk.layout.dof_names.index("root_x")] += 1e-7
    other = replace(walk, velocity=velocity)

    result = replay([other], tolerance=1e-6)
    beyond = replay([other], tolerance=1e-8).difference

    assert result.difference is None
    assert result.largest["m/s"] == pytest.approx(1e-7, rel=1e-6)
    assert result.largest["m"] == result.largest["rad/s"] == 0.0
    assert beyond is not None and (beyond.tick, beyond.name) == (31, "root_x")


# Commands


@pytest.mark.parametrize("side", ["applied", "commanded"])
def test_every_flipped_bit_of_a_torque_is_found(walk: Recording, side: str) -> None:
    rng = np.random.default_rng(3)
    norms, limits = walk.layout.norms(walk.effort), walk.character.effort_limits()
    assert not (norms >= limits).any()  # what a limit cuts away leaves no trace
    for _ in range(200):
        row, index, bit = (int(rng.integers(size)) for size in (TICKS, 34, 64))
        other = changed(walk.effort, row, index, bit)
        if side == "applied":
            suspect = replace(walk, effort=other)
        else:
            suspect = commanding(walk, row, other[row])

        difference = difference_of(suspect)

        assert difference is not None
        assert difference.name == walk.layout.dof_names[index], (row, bit, str(difference))
        assert difference.tick == row + 2


def test_what_limits_and_delays_have_made_of_a_command_is_known(pendulum: Recording) -> None:
    character = pendulum.character
    (limit,) = character.effort_limits()
    commands = [np.array([(-1) ** row * 3.0 * limit]) for row in range(len(pendulum.effort))]
    delayed = [np.zeros(1)] * 2 + [np.sign(effort) * limit for effort in commands[:-2]]
    sent = tuple((CommandArrays(("hinge",), effort, 0),) for effort in commands)
    late = with_parameters(
        replace(pendulum, effort=np.array(delayed), commands=(*sent, ())), command_delay_ticks=2
    )

    assert np.isfinite(limit)
    assert difference_of(late) is None
    difference = difference_of(with_parameters(late, command_delay_ticks=1))
    assert difference is not None and difference.tick == 3
    assert "commanded and clipped" in str(difference)


def test_commands_that_the_simulator_refused_do_not_count(walk: Recording) -> None:
    row, own = 9, walk.commands[9]
    refused = (
        CommandArrays(("nobody",), np.ones(1), 0),
        CommandArrays(("chest_x",), np.ones(1), 0),
        CommandArrays(("right_knee", "left_knee"), np.ones(1), 0),
    )
    commands = (*walk.commands[:row], (*refused, *own), *walk.commands[row + 1 :])

    assert difference_of(replace(walk, commands=commands)) is None


def test_of_two_different_commands_either_may_have_been_taken(walk: Recording) -> None:
    own, other = walk.effort[9], walk.effort[9] + 1.0

    assert difference_of(commanding(walk, 9, own, other)) is None
    assert difference_of(commanding(walk, 9, other, own)) is None
    assert difference_of(commanding(walk, 9, other)) is not None


def test_a_command_that_is_missing_is_told(walk: Recording) -> None:
    result = replay([commanding(walk, 9)])

    assert result.difference is None
    (note,) = result.remarks
    assert "lacks commands for 1 states" in note and str(walk.stamps_ns[9]) in note


@pytest.mark.parametrize("action", ["hold", "zero"])
def test_what_a_timeout_filled_in_is_known(walk: Recording, action: str) -> None:
    effort = walk.effort.copy()
    for row in (9, 10):
        effort[row] = effort[8] if action == "hold" else 0.0
    silent = commanding(commanding(replace(walk, effort=effort), 9), 10)

    assert difference_of(with_parameters(silent, on_timeout=action)) is None
    assert check_commands(with_parameters(silent, on_timeout=action)).silent_stamps_ns == ()
    paused = check_commands(with_parameters(silent, on_timeout="pause"))
    assert paused.silent_stamps_ns == tuple(walk.stamps_ns[9:11].tolist())
    wrong = replace(silent, effort=changed(effort, 10, walk.layout.dof_names.index("right_knee")))
    difference = difference_of(with_parameters(wrong, on_timeout=action))
    assert difference is not None and (difference.tick, difference.name) == (12, "right_knee")


@pytest.mark.parametrize("stamped", [True, False])
def test_in_real_time_a_command_is_held_until_it_is_too_old(
    pendulum: Recording, stamped: bool
) -> None:
    effort = np.zeros((len(pendulum.effort), 1))
    effort[3:8] = 1.5
    command = CommandArrays(("hinge",), np.array([1.5]), int(pendulum.published_ns[3]))
    commands = tuple((command,) if row == 3 and stamped else () for row in range(len(effort) + 1))
    holding = replace(
        pendulum,
        effort=effort,
        commands=commands,
        unstamped_commands=() if stamped else (command,),
    )
    holding = with_parameters(holding, mode="realtime", command_timeout=5.5 / 240.0)

    assert difference_of(holding) is None
    before = replace(holding, effort=effort.copy())
    before.effort[0] = 1.5
    difference = difference_of(before)
    assert difference is not None and difference.tick == 2
    other = difference_of(replace(holding, effort=changed(effort, 5, 0)))
    assert other is not None and (other.tick, other.name) == (7, "hinge")


def test_commands_that_never_acted_cannot_be_checked(walk: Recording) -> None:
    assert difference_of(commanding(walk, TICKS, walk.effort[0])) is None  # for the last state
    assert difference_of(commanding(walk, TICKS - 1, walk.effort[0])) is not None
    late = np.vstack((np.zeros((1, walk.layout.size)), walk.effort[:-1]))
    delayed = with_parameters(replace(walk, effort=late), command_delay_ticks=1)
    assert difference_of(delayed) is None
    assert difference_of(commanding(delayed, TICKS - 1, walk.effort[0])) is None
    assert difference_of(commanding(delayed, TICKS - 2, walk.effort[0])) is not None


# Worlds


def test_simulators_in_two_namespaces_are_two_worlds(tmp_path: Path) -> None:
    runs = [make_run("pendulum", 0.05), make_run("pendulum", 0.1, gravity=1.0)]
    with BagWriter(tmp_path / "bag") as bag:
        for name, made in zip(("a", "b"), runs, strict=True):
            add_to(bag, made.messages(), name)

    result = replay(read_recordings(tmp_path / "bag"))

    assert result.difference is None
    assert result.states == 13 + 25
    assert set(result.state_hashes) == {"a", "b"}


def test_a_world_that_was_not_recorded_whole_cannot_be_built(tmp_path: Path) -> None:
    made = make_run("pendulum", 0.05)
    messages = [raw_configuration(made.plan, "a", ("a", "b")), *made.messages()[1:]]
    bag = write_bag(tmp_path / "bag", messages, namespace="lab/a")
    (recording,) = read_recordings(bag)

    assert recording.world == RecordedWorld("lab", "a", ("a", "b"))
    with pytest.raises(RecordingError, match="lacks b, in whose world a was"):
        replay([recording])


def two_of_one_world(path: Path, left: slice, right: slice) -> Path:
    """A bag of two pendulums that are said to be in one world, with some of their states."""
    with BagWriter(path) as bag:
        for name, rows in (("left", left), ("right", right)):
            made = make_run("pendulum", 0.1)
            first = raw_configuration(made.plan, name, ("left", "right"))
            add_to(bag, [first, *raw_states(made.plan, made.states[rows])], name)
    return path


def test_a_state_more_of_one_character_is_left_out(tmp_path: Path) -> None:
    bag = two_of_one_world(tmp_path / "bag", slice(0, 24), slice(0, 25))

    together, remarks = read_world(bag)
    assert [len(each.stamps_ns) for each in together] == [24, 24] and remarks == []


def test_a_character_that_ends_before_the_others_is_an_error(tmp_path: Path) -> None:
    bag = two_of_one_world(tmp_path / "bag", slice(0, 23), slice(0, 25))

    message = "of left ends at tick 23, that of right, in the same world, at tick 25"
    with pytest.raises(RecordingError, match=message):
        replay(read_recordings(bag))
    with pytest.raises(RecordingError, match=message):
        read_world(bag)


def test_states_before_the_first_common_episode_are_told(pendulum: Recording) -> None:
    effort = pendulum.effort.copy()
    effort[9] = np.nan  # a reset
    early, rows = replace(pendulum, name="early", effort=effort), slice(10, None)
    late = replace(
        pendulum,
        name="late",
        stamps_ns=pendulum.stamps_ns[rows],
        effort=effort[rows],
    )

    cut, (note,) = cut_world([early, late])

    assert [each.stamps_ns.tolist() for each in cut] == [late.stamps_ns.tolist()] * 2
    assert note.startswith("the first 10 states of early were left out")


SLOPE = (
    '<robot name="slope"><link name="slope"><collision><origin rpy="0 0.2 0" xyz="0 0 -0.5"/>'
    '<geometry><box size="20 20 1"/></geometry></collision></link></robot>'
)


def test_terrain_lies_in_the_recording(tmp_path: Path) -> None:
    file = tmp_path / "slope.urdf"
    file.write_text(SLOPE)
    made = make_run("humanoid", 0.2, WALK, terrain=str(file))

    terrain = make_simulation_settings(made.plan.simulator).world.terrain
    text = configuration.describe(made.plan.character, made.plan.simulator, terrain=terrain)
    message = (CONFIGURATION, serialize_message(String(data=text)))
    bag = write_bag(tmp_path / "bag", [message, *made.messages()[1:]])
    file.unlink()

    recordings = read_recordings(bag)

    assert replay(recordings).difference is None
    flat = replace(recordings[0], world=RecordedWorld())
    with pytest.raises(RecordingError, match="lacks its terrain"):
        replay([flat])
    assert replay([with_parameters(flat, terrain="plane")]).difference is not None


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"rate": "often"}, "cannot be built again"),
        ({"turbo": 1}, r"unknown parameter 'turbo'.*; recorded with numpy 99\.0 \(now "),
    ],
)
def test_a_simulator_of_another_kind_or_version_is_told(
    pendulum: Recording, parameters: Mapping[str, object], reason: str
) -> None:
    newer = replace(pendulum, versions={**installed_versions(), "numpy": "99.0"})

    with pytest.raises(RecordingError, match=reason):
        replay([with_parameters(newer, **parameters)])


def test_pushes_act_again(pendulum: Recording) -> None:
    push = WrenchArrays.of_rows(
        int(pendulum.stamps_ns[6]), ["rod"], [(5.0, 0.0, 0.0, 0.0, 0.0, 0.0)], []
    )
    pushed = (*pendulum.applied_wrench[:5], push, *pendulum.applied_wrench[6:])

    difference = replay([replace(pendulum, applied_wrench=pushed)]).difference

    assert difference is not None and difference.tick == 7


def test_pushes_that_are_not_known_are_told(pendulum: Recording) -> None:
    sent = replace(pendulum, pushes_sent=2, applied_wrench=())
    with pytest.raises(RecordingError, match="2 messages on 'external_wrench'"):
        replay([sent])
    partly = (*pendulum.applied_wrench[:5], None, *pendulum.applied_wrench[6:])
    with pytest.raises(RecordingError, match="in 1 ticks"):
        replay([replace(sent, applied_wrench=partly)])
    assert replay([replace(pendulum, applied_wrench=partly)]).difference is None
    none = replay([replace(pendulum, applied_wrench=())])
    assert none.difference is None and "without pushes" in none.remarks[0]
    wrong = WrenchArrays.of_rows(0, ["tail"], [(0.0,) * 6], [])
    with pytest.raises(RecordingError, match="unknown link 'tail'"):
        replay([replace(pendulum, applied_wrench=(wrong, *pendulum.applied_wrench[1:]))])
