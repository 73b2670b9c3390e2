"""A recording read back is the run itself, to the bit; what is none says so in a line."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bags import (
    CONFIGURATION,
    Made,
    add_to,
    make_run,
    said_configuration,
    said_references,
    said_states,
    said_wrenches,
    write_bag,
)
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from experiment.bags.recording import Recording, read_recording
from experiment.bags.writer import BagWriter
from msgs_config import topics
from msgs_config.errors import ActuatedCharactersError, MessageError, RecordingError
from msgs_config.messages import JointStateEncoder
from msgs_config.stamped import StampedState
from msgs_config.wrench_messages import WrenchArrays

WALK = {"reference": "clip", "clip": "walk"}
PLACEMENT = [1.0, -2.0, 0.5, 0.7]
LONG = 5000  # ticks


@pytest.fixture(scope="module")
def walk() -> Made:
    return make_run("humanoid", 0.1, WALK)


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


def assert_same_states(recording: Recording, made: Made) -> None:
    """Stamps, positions, velocities and efforts are those of the run, to the bit."""
    assert recording.stamps_ns.tolist() == [state.stamp_ns for state in made.states]
    for row, state in enumerate(made.states):
        assert recording.position[row].tobytes() == state.position.tobytes()
        assert recording.velocity[row].tobytes() == state.velocity.tobytes()
    for row, tick in enumerate(made.ticks):
        assert tick.following.effort is not None
        assert recording.effort[row].tobytes() == tick.following.effort.tobytes()


# What a recording says


def test_a_recording_has_the_runs_own_states_efforts_and_references(
    walk: Made, tmp_path: Path
) -> None:
    recording = read_recording(write_bag(tmp_path / "bag", walk.messages()))

    assert len(walk.ticks) == 24
    assert_same_states(recording, walk)
    for row, tick in enumerate(walk.ticks):
        assert tick.reference is not None
        assert recording.reference_position[row].tobytes() == tick.reference.position.tobytes()
        assert recording.reference_velocity[row].tobytes() == tick.reference.velocity.tobytes()
    # nobody answers the last state
    assert np.isnan(recording.reference_position[-1]).all()
    assert recording.contacts == recording.applied_wrench == ()


def test_it_knows_the_character_and_the_parameters(walk: Made, tmp_path: Path) -> None:
    recording = read_recording(write_bag(tmp_path / "bag", walk.messages()))

    assert recording.character == walk.plan.character
    assert recording.layout.dof_names == walk.plan.character.layout.dof_names
    assert recording.parameters["rate"] == 240
    assert recording.parameters["terrain"] == "plane"


def test_times_begin_at_zero_with_the_first_state(walk: Made, tmp_path: Path) -> None:
    recording = read_recording(write_bag(tmp_path / "bag", walk.messages()))

    np.testing.assert_allclose(recording.times, np.arange(25) / 240.0, atol=2e-9)


def test_a_runs_directory_is_as_good_as_the_bag_in_it(pendulum: Made, tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", pendulum.messages())

    assert_same_states(read_recording(tmp_path), pendulum)


def test_the_character_stands_where_it_was_placed(tmp_path: Path) -> None:
    made = make_run("kuka", 0.02, placement=PLACEMENT)

    recording = read_recording(write_bag(tmp_path / "bag", made.messages()))

    pose = recording.character.links[0].joint.pose_in_parent
    assert pose.position == tuple(PLACEMENT[:3])
    assert recording.character == made.plan.character


def test_names_may_come_in_any_order(walk: Made, tmp_path: Path) -> None:
    layout = walk.plan.character.layout
    order = np.random.default_rng(1).permutation(layout.size)
    encoder = JointStateEncoder([layout.dof_names[index] for index in order])
    shuffled = [
        (
            topics.JOINT_STATES,
            encoder.encode(
                state.stamp_ns,
                state.position[order],
                state.velocity[order],
                *(() if state.effort is None else (state.effort[order],)),
            ),
        )
        for state in walk.states
    ]

    recording = read_recording(
        write_bag(tmp_path / "bag", [said_configuration(walk.plan), *shuffled])
    )

    assert_same_states(recording, walk)
    assert np.isnan(recording.reference_position).all()


def test_a_state_that_was_published_again_counts_once(pendulum: Made, tmp_path: Path) -> None:
    states = said_states(pendulum.plan, pendulum.states)
    again = [states[0], *states[:3], states[1], states[2], *states[3:], states[-1]]

    recording = read_recording(
        write_bag(tmp_path / "bag", [said_configuration(pendulum.plan), *again])
    )

    assert_same_states(recording, pendulum)


def test_what_comes_before_the_configuration_counts_too(pendulum: Made, tmp_path: Path) -> None:
    configuration, *rest = pendulum.messages()

    assert_same_states(
        read_recording(write_bag(tmp_path / "bag", [*rest, configuration])), pendulum
    )


def test_a_tick_that_was_a_reset_has_no_effort(pendulum: Made, tmp_path: Path) -> None:
    states = list(pendulum.states)
    states[5] = replace(states[5], effort=None)

    recording = read_recording(
        write_bag(
            tmp_path / "bag",
            [said_configuration(pendulum.plan), *said_states(pendulum.plan, states)],
        )
    )

    assert np.isnan(recording.effort).all(axis=1).tolist() == [
        row == 4 for row in range(len(pendulum.ticks))
    ]


def test_a_reference_counts_at_its_stamp(pendulum: Made, tmp_path: Path) -> None:
    third = pendulum.ticks[3].reference
    assert third is not None
    of_nobody = replace(third, stamp_ns=third.stamp_ns + 1)

    recording = read_recording(
        write_bag(
            tmp_path / "bag",
            [
                *said_references(pendulum.plan, [third, of_nobody]),
                said_configuration(pendulum.plan),
                *said_states(pendulum.plan, pendulum.states),
            ],
        )
    )

    known = ~np.isnan(recording.reference_position[:, 0])
    assert np.flatnonzero(known).tolist() == [3]


@pytest.mark.parametrize("name", ["contacts", "applied_wrench"])
def test_wrenches_belong_to_the_tick_that_their_stamp_ends(
    pendulum: Made, tmp_path: Path, name: str
) -> None:
    topic = {"contacts": topics.CONTACTS, "applied_wrench": topics.APPLIED_WRENCH}[name]
    stamps = [state.stamp_ns for state in pendulum.states]
    touch = WrenchArrays.of_rows(stamps[3], ["rod"], [(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)], [])
    nothing = WrenchArrays.of_rows(stamps[6], [], [], [])
    messages = [*pendulum.messages(), *said_wrenches(topic, [nothing, touch])]

    recording = read_recording(write_bag(tmp_path / "bag", messages))

    found = getattr(recording, name)
    assert len(found) == len(pendulum.ticks)
    assert [row for row, wrenches in enumerate(found) if wrenches is not None] == [2, 5]
    assert (found[2].links, found[5].links) == (("rod",), ())
    np.testing.assert_array_equal(found[2].wrenches, touch.wrenches)


def test_names_may_be_in_a_namespace(walk: Made, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", walk.messages(), namespace="robots/left")

    assert_same_states(read_recording(bag), walk)


def test_a_long_recording_is_read_in_a_moment(walk: Made, tmp_path: Path) -> None:
    clock = 1_000_000_000
    template = walk.states[1]
    states = [replace(template, stamp_ns=k * clock // 240) for k in range(1, LONG + 2)]
    stand_ins = [
        replace(walk.ticks[0].reference, stamp_ns=state.stamp_ns)  # type: ignore[type-var]
        for state in states
    ]
    touch = [WrenchArrays.of_rows(s.stamp_ns, ["chest"], [(1.0,) * 6], []) for s in states]
    bag = write_bag(
        tmp_path / "bag",
        [
            said_configuration(walk.plan),
            *said_states(walk.plan, states),
            *said_references(walk.plan, stand_ins),
            *said_wrenches(topics.CONTACTS, touch),
        ],
    )

    started = time.process_time()
    recording = read_recording(bag)

    assert time.process_time() - started < 2.0
    assert recording.effort.shape == (LONG, 34)


# What is none


def refusal(path: Path) -> str:
    """Why there is no recording to read, in one line."""
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    assert refusal(tmp_path / "nothing") == f"no run or recording at {tmp_path / 'nothing'}"


def test_a_run_without_a_bag_has_none(tmp_path: Path) -> None:
    (tmp_path / "summary.json").touch()

    assert refusal(tmp_path).startswith(f"no recording in {tmp_path}")


def test_a_bag_that_was_not_finished_is_none(pendulum: Made, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", pendulum.messages())
    (bag / "metadata.yaml").unlink()

    assert "no complete recording" in refusal(tmp_path)


def test_a_bag_without_states_is_none(pendulum: Made, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", [said_configuration(pendulum.plan)])

    assert "no states" in refusal(bag)


def test_a_bag_without_the_simulators_configuration_is_none(pendulum: Made, tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", said_states(pendulum.plan, pendulum.states))

    assert "sim_node/configuration" in refusal(bag)


def test_several_characters_are_named(pendulum: Made, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as bag:
        for namespace in ("left", "right"):
            add_to(bag, pendulum.messages(), namespace)

    line = refusal(tmp_path / "bag")

    assert "several characters" in line and "/left/" in line and "/right/" in line


def test_two_simulators_are_told_apart(pendulum: Made, tmp_path: Path) -> None:
    other = make_run("pendulum", 0.01, gravity=1.0)
    messages = [*pendulum.messages(), said_configuration(other.plan)]

    assert "several simulators" in refusal(write_bag(tmp_path / "bag", messages))


def test_ticks_that_are_missing_are_named(pendulum: Made, tmp_path: Path) -> None:
    states = [state for row, state in enumerate(pendulum.states) if row not in (4, 5)]
    messages = [said_configuration(pendulum.plan), *said_states(pendulum.plan, states)]

    assert "ticks 5 to 6" in refusal(write_bag(tmp_path / "bag", messages))


def test_a_character_that_is_another_one_now_is_refused(tmp_path: Path) -> None:
    urdf = tmp_path / "thing.urdf"
    text = Path("msgs_config/characters/pendulum.urdf").read_text()
    urdf.write_text(text)
    yaml = tmp_path / "thing.yaml"
    yaml.write_text("urdf: thing.urdf\nfixed_base: true\n")
    made = make_run(str(yaml), 0.02)
    bag = write_bag(tmp_path / "bag", made.messages())
    assert_same_states(read_recording(bag), made)

    urdf.write_text(text.replace('<mass value="1.0"/>', '<mass value="2.0"/>'))
    assert "another mass" in refusal(bag)
    urdf.unlink()
    assert "cannot load its character" in refusal(bag) and str(urdf) in refusal(bag)


@pytest.mark.parametrize("said", ["no JSON", "{}", '{"character": 1, "joints": []}'])
def test_a_configuration_of_somebody_else_is_refused(
    pendulum: Made, tmp_path: Path, said: str
) -> None:
    messages = [
        (CONFIGURATION, serialize_message(String(data=said))),
        *said_states(pendulum.plan, pendulum.states),
    ]

    with pytest.raises(MessageError, match="configuration"):
        read_recording(write_bag(tmp_path / "bag", messages))


def test_states_of_something_else_are_refused(pendulum: Made, tmp_path: Path) -> None:
    state = StampedState(pendulum.states[0].stamp_ns, np.zeros(1), np.zeros(1), None)
    raw = JointStateEncoder(["elbow"]).encode(state.stamp_ns, state.position, state.velocity)
    messages = [said_configuration(pendulum.plan), (topics.JOINT_STATES, raw)]

    with pytest.raises(ActuatedCharactersError, match="elbow"):
        read_recording(write_bag(tmp_path / "bag", messages))
