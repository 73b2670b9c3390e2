"""The figures of a run, against numbers that can be worked out by hand."""

import hashlib
import math
import struct
from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message

from actuated_characters.metrics import collector as collector_module
from actuated_characters.metrics.collector import MetricsCollector
from actuated_characters.metrics.error_measures import is_lost
from actuated_characters.metrics.run_metrics import COLUMNS, Measurement, Tick
from actuated_characters.metrics.state_hash import StateHash
from actuated_characters.metrics.tick_assembler import MOST_AHEAD, TickAssembler
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import ROOT, JointLayout, JointType
from msgs_config.errors import ActuatedCharactersError, ClockError, RecordingError
from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.configuration import RunConfiguration
from msgs_config.messages.state import StampedReference, StampedState
from tests.support.bags import Made, make_run, raw_configuration, raw_references, raw_states
from tests.support.physics import character

RATE = 100
CLOCK = TickClock(RATE)
LAYOUT = JointLayout(
    [
        (ROOT, JointType.FLOATING),
        ("chest", JointType.SPHERICAL),
        ("knee", JointType.REVOLUTE),
        ("slider", JointType.PRISMATIC),
    ]
)
KNOWN = RunConfiguration(
    character="test",
    layout=LAYOUT,
    effort_limits=np.array([math.inf, math.inf, 10.0, 5.0, math.inf]),  # root's, then the joints'
    mass=20.0,
    parameters={"rate": RATE, "gravity": 10.0},
)
QUARTER = math.pi / 2


def entries(
    root: Iterable[float] = (0.0, 0.0, 1.0),
    turn: Iterable[float] = (0.0, 0.0, 0.0),
    chest: Iterable[float] = (0.0, 0.0, 0.0),
    knee: float = 0.0,
    slider: float = 0.0,
) -> FloatArray:
    """Positions of all degrees of freedom, upright at 1 m where nothing is said."""
    return np.array([*root, *turn, *chest, knee, slider])


def efforts(
    root: Iterable[float] = (0.0, 0.0, 0.0), chest: Iterable[float] = (0.0, 0.0, 0.0), **of: float
) -> FloatArray:
    """Efforts on all degrees of freedom, zero where nothing is said."""
    return entries(root, chest=chest, **of)


NONE = efforts()
CHEST = (0.0, 0.6, 0.8)
EXACT = 1e-9  # rad: exact but for what a controlled joint is off as it moves


def state(tick: int, position: FloatArray, effort: FloatArray | None = NONE) -> StampedState:
    """A state; `effort` is what was applied before it, None in the first of an episode."""
    return StampedState(CLOCK.stamp_ns(tick), position, 0.5 * position, effort)


def reference(tick: int, position: FloatArray) -> StampedReference:
    return StampedReference(CLOCK.stamp_ns(tick), position, np.zeros(len(position)))


def measured(
    ticks: Iterable[tuple[FloatArray, FloatArray | None, FloatArray]],
    known: RunConfiguration = KNOWN,
    wall_time: float = 1.0,
) -> dict[str, object]:
    """The figures of ticks, each with its position, its reference's, and its effort."""
    measurement = Measurement(known)
    tick = 1
    measurement.add_state(state(1, np.zeros(known.layout.size), None))
    for tick, (position, desired, applied) in enumerate(ticks, start=1):
        wanted = None if desired is None else reference(tick, desired)
        following = state(tick + 1, position, applied)
        measurement.add_state(following)
        measurement.add_tick(Tick(state(tick, position), following, wanted))
    return measurement.summary(wall_time)


# Errors


@pytest.mark.parametrize(
    ("found", "desired", "angle"),
    [
        ((0.0, 0.0, 0.3), (0.0, 0.0, -0.1), 0.4),
        ((0.0, 0.0, 0.3), (0.0, 0.0, 0.3), 0.0),
        ((QUARTER, 0.0, 0.0), (0.0, QUARTER, 0.0), 2.0 * math.pi / 3.0),  # a third of a turn
        ((0.0, 0.0, 3.1), (0.0, 0.0, -3.1), 2.0 * math.pi - 6.2),  # on both sides of pi
        ((0.0, math.pi, 0.0), (0.0, 0.0, 0.0), math.pi),
    ],
)
def test_a_ball_joints_error_is_the_angle_between_its_two_rotations(
    found: tuple[float, ...], desired: tuple[float, ...], angle: float
) -> None:
    metrics = measured([(entries(chest=found), entries(chest=desired), NONE)])

    assert metrics["joint_error_mean_rad"] == pytest.approx(angle / 2.0, abs=1e-9)  # and the knee


def test_errors_are_means_over_joints_and_ticks_of_angles_and_distances() -> None:
    metrics = measured(
        [
            # a hinge that turns knows its turns; the root's turn is none of a joint
            (entries(knee=4.0, turn=(0.0, 0.0, 1.0)), entries(knee=-2.0), NONE),
            (entries(root=(3.0, 4.0, 1.0), slider=7.0), entries(chest=CHEST, knee=EXACT), NONE),
            (entries(root=(0.0, 0.0, 2.0), knee=-0.5), entries(knee=0.3, slider=2.0), NONE),
        ]
    )

    assert metrics["joint_error_mean_rad"] == pytest.approx((6.0 + 1.0 + 0.8) / 2.0 / 3.0)
    assert metrics["root_error_mean_m"] == pytest.approx((0.0 + 5.0 + 1.0) / 3.0)
    assert metrics["root_error_max_m"] == pytest.approx(5.0)
    assert metrics["slider_error_mean_m"] == pytest.approx((0.0 + 7.0 + 2.0) / 3.0)
    assert metrics["slider_error_max_m"] == pytest.approx(7.0)


def test_ticks_without_a_reference_have_no_error_but_count() -> None:
    metrics = measured(
        [
            (entries(knee=1.0), None, NONE),
            (entries(knee=1.0), entries(knee=0.5), NONE),
            (entries(knee=1.0, root=(0.0, 0.0, 0.1)), None, efforts(knee=5.0)),
        ]
    )

    assert metrics["ticks"] == 3
    assert metrics["joint_error_mean_rad"] == pytest.approx(0.25)
    assert metrics["root_error_mean_m"] == 0.0
    assert metrics["saturated_fraction"] == pytest.approx(1.0 / 9.0)


def test_what_cannot_be_measured_is_none() -> None:
    layout = JointLayout([("height", JointType.PRISMATIC)])
    slider = replace(KNOWN, layout=layout, effort_limits=np.array([5.0]))
    of_reference = ("joint_error_mean_rad", "root_error_mean_m", "root_error_max_m", "fell")

    alone = measured([(np.array([0.5]), np.array([1.0]), np.array([5.0]))], slider)
    for metrics in (measured([(entries(), None, NONE)]), measured([]), alone):
        assert all(metrics[name] is None for name in of_reference)

    assert alone["assist_force_mean_n"] is None
    assert (alone["saturated_fraction"], alone["slider_error_mean_m"]) == (1.0, 0.5)
    assert measured([])["saturated_fraction"] is measured([])["slider_error_max_m"] is None


# Efforts


def test_assistance_is_the_length_of_the_roots_force_and_weight_is_the_bodys() -> None:
    metrics = measured(
        [
            (entries(), entries(), entries((0.0, 3.0, -4.0), turn=(9.0, 9.0, 9.0))),
            (entries(), entries(), efforts(root=(2.0, 0.0, 0.0))),
        ]
    )

    assert metrics["assist_force_mean_n"] == pytest.approx(3.5)
    assert metrics["body_weight_n"] == pytest.approx(200.0)


def test_a_joint_at_its_limit_is_saturated_and_a_ball_joint_by_its_length() -> None:
    metrics = measured(
        [
            (entries(), entries(), efforts(chest=(6.0, 0.0, -8.0), knee=4.99)),
            (entries(), entries(), efforts(chest=(9.9, 0.0, 0.0), knee=-5.0)),
            (entries(), entries(), efforts(chest=(5.7, 5.7, 5.7), knee=0.0)),
            (entries(), entries(), efforts(root=(1e6, 0.0, 0.0), slider=1e6)),
        ]
    )

    assert metrics["saturated_fraction"] == pytest.approx(2.0 / 12.0)  # three joints, four ticks


@pytest.mark.parametrize(
    ("commanded", "count", "of_root"), [(["root", "knee"], 7, 6), (["chest", "knee"], 4, 0)]
)
def test_actuators_are_the_commanded_degrees_of_freedom(
    commanded: list[str], count: int, of_root: int
) -> None:
    known = replace(KNOWN, parameters={**KNOWN.parameters, "commanded_joints": commanded})

    metrics = measured([], known)

    assert (metrics["actuators"], metrics["root_actuators"]) == (count, of_root)
    assert metrics["degrees_of_freedom"] == 11


# A motion that is lost


@pytest.mark.parametrize(
    ("centre", "fails"),
    [
        ((0.59, 0.0, 0.9), False),
        ((0.0, 0.61, 0.9), True),
        ((0.0, 0.0, 0.46), False),
        ((0.0, 0.0, 0.44), True),
    ],
)
def test_a_motion_is_lost_where_the_centre_of_mass_is_far_or_low(
    centre: tuple[float, ...], fails: bool
) -> None:
    assert is_lost(np.array(centre), np.array((0.0, 0.0, 0.9))) is fails


# Time


@pytest.mark.parametrize(
    ("count", "wall_time", "factor"), [(50, 0.125, 4.0), (1, 0.0, None), (0, 1.0, 0.0)]
)
def test_simulated_time_is_that_between_the_first_and_the_last_state(
    count: int, wall_time: float, factor: float | None
) -> None:
    metrics = measured([(entries(), entries(), NONE)] * count, wall_time=wall_time)

    assert metrics["ticks"] == count
    assert metrics["sim_time_s"] == pytest.approx(count / RATE)
    assert metrics["wall_time_s"] == wall_time
    assert metrics["real_time_factor"] == (None if factor is None else pytest.approx(factor))


@pytest.mark.parametrize("count", [255, 256, 257, 513])
def test_where_one_block_ends_and_the_next_begins_does_not_matter(count: int) -> None:
    rng = np.random.default_rng(7)
    ticks = []
    for _ in range(count):
        applied = efforts(chest=rng.uniform(0.0, 8.0, 3), knee=rng.choice([5.0, 1.0]))
        here, there = (entries(root=rng.normal(size=3), knee=rng.normal()) for _ in range(2))
        ticks.append((here, there, applied))

    metrics = measured(ticks)

    roots = [math.dist(here[:3], there[:3]) for here, there, _ in ticks]
    knees = [abs(here[9] - there[9]) for here, there, _ in ticks]
    at_limit = [int(math.hypot(*e[6:9]) >= 10.0) + int(e[9] == 5.0) for *_, e in ticks]
    assert metrics["ticks"] == count
    assert metrics["root_error_mean_m"] == pytest.approx(np.mean(roots))
    assert metrics["root_error_max_m"] == pytest.approx(max(roots))
    assert metrics["joint_error_mean_rad"] == pytest.approx(np.mean(knees) / 2.0)
    assert metrics["saturated_fraction"] == pytest.approx(sum(at_limit) / (3 * count))


def test_the_series_has_one_row_a_tick_and_looking_at_it_changes_nothing() -> None:
    measurement = Measurement(KNOWN)
    for tick in range(1, 301):
        desired = None if tick == 3 else reference(tick, entries(knee=0.5, slider=2.0))
        now = state(tick, entries(knee=0.01 * tick, slider=1.0))
        measurement.add(Tick(now, state(tick + 1, entries(), efforts(slider=3.0)), desired))
        if tick in (1, 100, 256):
            assert len(measurement.series()["time_s"]) == tick

    columns = measurement.series()

    sliders = ("position.slider", "reference_position.slider", "effort.slider")
    assert tuple(columns) == (*COLUMNS, *sliders)
    assert [columns[name][-1] for name in sliders] == [1.0, 2.0, 3.0]
    assert columns["time_s"] == pytest.approx(np.arange(300) / RATE)
    assert math.isnan(columns["joint_error_mean_rad"][2])
    assert columns["joint_error_max_rad"][99] == pytest.approx(0.5)
    assert columns["joint_error_mean_rad"][99] == pytest.approx(0.25)
    assert columns["root_height_m"] == pytest.approx(np.ones(300))
    assert measurement.summary(1.0)["ticks"] == 300


# The hash


def hash_of(*states: StampedState) -> str:
    state_hash = StateHash()
    for one in states:
        state_hash.add(one)
    return state_hash.hexdigest()


def test_the_hash_is_over_stamp_position_and_velocity_of_every_state() -> None:
    first, second = state(1, entries(knee=0.1), None), state(2, entries(knee=0.2))

    content = b"".join(
        struct.pack("<q22d", one.stamp_ns, *one.position, *one.velocity) for one in (first, second)
    )

    assert hash_of(first, second) == hashlib.sha256(content).hexdigest()


def test_the_smallest_difference_gives_another_hash() -> None:
    one = state(1, entries(knee=0.1))
    changed = [
        state(2, entries(knee=0.1)),
        state(1, entries(knee=np.nextafter(0.1, 1.0))),
        state(1, entries(knee=0.1, slider=-0.0)),
        replace(one, velocity=np.nextafter(one.velocity, 1.0)),
        replace(one, position=one.velocity, velocity=one.position),
    ]

    hashes = {hash_of(one), hash_of(one, one), *(hash_of(other) for other in changed)}

    assert len(hashes) == 2 + len(changed)
    assert hash_of(replace(one, effort=None)) == hash_of(one)


# Putting states and references together


def take(order: Iterable[StampedState | StampedReference]) -> tuple[TickAssembler, Measurement]:
    """An assembler that has got all of these, in their order, and its measurement."""
    measurement = Measurement(KNOWN)
    assembler = TickAssembler(measurement, RATE)
    for thing in order:
        if isinstance(thing, StampedState):
            assembler.add_state(thing)
        else:
            assembler.add_reference(thing)
    assembler.finish()
    return assembler, measurement


def assembled(order: Iterable[StampedState | StampedReference]) -> tuple[dict[str, object], int]:
    """The figures and the number of missing ticks."""
    assembler, measurement = take(order)
    return measurement.summary(1.0), assembler.missing_ticks


STATES = [
    state(tick, entries(knee=0.1 * tick), efforts(knee=0.1 * tick) if tick > 1 else None)
    for tick in range(1, 11)
]
REFERENCES = [reference(tick, entries(knee=0.2 * tick)) for tick in range(1, 11)]


def test_each_state_meets_its_reference_and_the_effort_that_the_next_state_tells() -> None:
    metrics, missing = assembled([*STATES[:3], *REFERENCES[:3]])

    assert missing == 0
    assert metrics["ticks"] == 2  # what is applied to the last state nobody has said yet
    assert metrics["joint_error_mean_rad"] == pytest.approx((0.1 + 0.2) / 2.0 / 2.0)
    assert metrics["state_hash"] == hash_of(*STATES[:3])


PAIRS = list(zip(STATES, REFERENCES, strict=True))
ORDERS = {
    "states first": [*STATES, *REFERENCES],
    "references first": [*REFERENCES, *STATES],
    "references backwards": [*STATES, *reversed(REFERENCES)],
    "each three times": [thing for pair in PAIRS for thing in 3 * pair],
    "all twice": [*STATES, *STATES, *REFERENCES, *REFERENCES],
}


@pytest.mark.parametrize("order", ORDERS)
def test_order_and_repetition_change_nothing(order: str) -> None:
    in_turn = assembled([thing for pair in PAIRS for thing in pair])

    assert in_turn[0]["ticks"] == 9
    assert in_turn[0]["joint_error_mean_rad"] == pytest.approx(0.1 * 5.0 / 2.0)
    assert assembled(ORDERS[order]) == in_turn


def test_missing_ticks_are_counted() -> None:
    gaps = [one for index, one in enumerate(STATES) if index not in (3, 6, 7)]

    assert assembled(gaps)[1] == 3
    assert assembled(STATES)[1] == 0


RESET = [*STATES[:5], replace(STATES[5], effort=None), *STATES[6:]]


@pytest.mark.parametrize(
    ("states", "references", "measured_ticks"),
    [
        (STATES, [*REFERENCES[:4], *REFERENCES[5:]], (1, 2, 3, 4, 6, 7, 8, 9)),
        (RESET, REFERENCES, (1, 2, 3, 4, 6, 7, 8, 9)),
    ],
    ids=["a reference never comes", "between two episodes there is no tick"],
)
def test_a_tick_that_cannot_be_measured_leaves_the_others_theirs(
    states: list[StampedState], references: list[StampedReference], measured_ticks: tuple[int, ...]
) -> None:
    metrics, missing = assembled([*states, *references])

    assert missing == 0
    assert metrics["ticks"] == (9 if states is STATES else 8)
    errors = [0.1 * tick / 2.0 for tick in measured_ticks]
    assert metrics["joint_error_mean_rad"] == pytest.approx(np.mean(errors))
    assert metrics["state_hash"] == hash_of(*states)


def test_references_wait_only_for_the_states_that_they_belong_to() -> None:
    sound = assembled([*STATES, *REFERENCES])
    far = [reference(tick, entries(knee=9.0)) for tick in range(11 + MOST_AHEAD, 200 + MOST_AHEAD)]
    between = [replace(one, stamp_ns=one.stamp_ns + 5) for one in REFERENCES]
    late = [replace(one, stamp_ns=-5) for one in REFERENCES]
    strange = [*far, *between, *late]

    for order in ([*STATES, *strange, *REFERENCES], [*strange, *STATES, *REFERENCES]):
        assert assembled(order) == sound
    gap = [one for index, one in enumerate(STATES) if index != 4]
    assembler, _ = take([*REFERENCES, *gap, *far])
    assert assembler.dropped_references == len(far) + 1


def test_a_flood_of_references_takes_a_bounded_memory_and_is_counted() -> None:
    flood = [reference(tick, entries(knee=1.0)) for tick in range(1, 40_000)]

    assert take(flood)[0].dropped_references == 39_999 - 11_000
    assembler, _ = take([*STATES, *flood])
    assert assembler.dropped_references == 39_999 - 10 - MOST_AHEAD
    assembler.add_state(replace(STATES[0], stamp_ns=reference(30_000, entries()).stamp_ns))
    assembler.finish()
    assert assembler.dropped_references == 39_999 - 10


def test_a_state_that_is_no_tick_is_an_error() -> None:
    assembler = TickAssembler(Measurement(KNOWN), RATE)

    with pytest.raises(ClockError, match="12345"):
        assembler.add_state(replace(STATES[0], stamp_ns=12345))


# Listening to serialised messages

Message = tuple[str, bytes, int]
SIMULATOR, CONTROLLER = topics.SIM_NODE, topics.CONTROLLER_NODE
STATE, TORQUE = topics.JOINT_STATES.name, topics.JOINT_TORQUES.name
REFERENCE = topics.REFERENCE.of(CONTROLLER).name
CONFIGURATION = topics.CONFIGURATION.of(SIMULATOR).name
MILLISECOND = 10**6


@cache
def pendulum(**simulator: object) -> Made:
    return make_run("pendulum", 20 / 240, **simulator)


def configuration_message(**given: object) -> Message:
    return CONFIGURATION, raw_configuration(pendulum(**given).plan)[1], 0


def report(name: str, published_ns: int, **values: object) -> Message:
    items = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    message = DiagnosticArray(status=[DiagnosticStatus(name=name, values=items)])
    return topics.DIAGNOSTICS.name, serialize_message(message), published_ns


def pendulum_messages() -> list[Message]:
    """What a recorder hears of a pendulum: in each ms a state, and its reference; and a torque."""
    made = pendulum()
    references = [tick.reference for tick in made.ticks if tick.reference is not None]
    states = enumerate(raw_states(made.plan, made.states), start=1)
    desired = enumerate(raw_references(made.plan, references), start=1)
    messages = [(REFERENCE, raw, at * MILLISECOND) for at, (_, raw) in desired]
    messages += [(STATE, raw, at * MILLISECOND) for at, (_, raw) in states]
    messages.append((TORQUE, b"", MILLISECOND + 1000))
    return sorted(messages, key=lambda message: message[2])


def heard(messages: Iterable[Message]) -> MetricsCollector:
    collector = MetricsCollector()
    for message in messages:
        collector.take(*message)
    return collector


def test_a_listener_gives_the_figures_of_the_run_that_it_hears() -> None:
    collector = heard([configuration_message(), *pendulum_messages()])

    metrics, series = collector.results()

    assert metrics["character"] == "pendulum"
    assert collector.last_tick == 21
    assert collector.missing_ticks == metrics["missing_ticks"] == 0
    assert metrics["ticks"] == 20
    assert metrics["sim_time_s"] == pytest.approx(20 / 240, abs=1e-8)
    assert metrics["wall_time_s"] == pytest.approx(0.020 - 1e-6)  # first torque to last state
    assert metrics["rejected_commands"] is metrics["duplicate_commands"] is None  # nobody said
    mass_kg = character("pendulum").mass
    assert metrics["body_weight_n"] == pytest.approx(9.81 * mass_kg)
    assert list(series) == list(COLUMNS)
    assert {len(column) for column in series.values()} == {20}
    assert metrics["state_hash"] == hash_of(*pendulum().states)


def test_early_and_repeated_messages_change_nothing() -> None:
    messages, configured = pendulum_messages(), configuration_message()
    topic, raw, _ = messages[-1]
    metrics = heard([configured, *messages]).results()[0]

    assert heard([*messages, configured]).results()[0] == metrics
    assert heard([configured, *messages[:30], configured, *messages[30:]]).results()[0] == metrics
    assert heard([configured, *messages, (topic, raw, 10**12)]).results()[0] == metrics


def test_however_late_a_configuration_comes_the_newest_messages_are_measured() -> None:
    messages, configured = pendulum_messages(), configuration_message()
    metrics = heard([configured, *messages]).results()[0]
    many = [messages[0]] * 30_000  # seconds of a reference, until the simulator is heard
    large = [(topics.DIAGNOSTICS.name, bytes(1 << 24), 0)] * 5

    for early in many, large:
        assert heard([*early, *messages[:30], configured, *messages[30:]]).results()[0] == metrics


def test_states_that_could_not_be_kept_until_a_configuration_are_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    messages = [each for each in pendulum_messages() if each[0] == STATE]
    monkeypatch.setattr(collector_module, "_MOST_EARLY", len(messages) - 3)

    collector = heard([*messages, configuration_message()])

    assert collector.missing_ticks == collector.results()[0]["missing_ticks"] == 3


def test_without_a_configuration_there_are_no_figures() -> None:
    with pytest.raises(RecordingError, match="nothing on 'sim_node/configuration'"):
        heard(pendulum_messages()).results()
    with pytest.raises(RecordingError, match="no simulator was heard"):
        heard([]).results()


def test_commands_are_counted_as_the_simulator_reports_them_last() -> None:
    messages = [
        report(SIMULATOR, 5, rejected=1, duplicate=2, tick=3),
        report("some_other_node", 6, rejected=70, duplicate=70),
        report(f"other/{SIMULATOR}", 6, rejected=71, duplicate=71),  # another character's
        report(SIMULATOR, 7, rejected=4, duplicate=5, tick=20),
        report(SIMULATOR, 8),
    ]

    metrics = heard([configuration_message(), *messages, *pendulum_messages()]).results()[0]

    assert (metrics["rejected_commands"], metrics["duplicate_commands"]) == (4, 5)


def test_a_simulator_that_is_restarted_is_an_error() -> None:
    collector = heard([configuration_message(), *pendulum_messages()])

    with pytest.raises(RecordingError, match="restarted"):
        collector.take(*configuration_message(gravity=1.62))


@pytest.mark.parametrize("topic", [STATE, REFERENCE, CONFIGURATION])
@pytest.mark.parametrize("raw", [b"", b"\x00\x01\x00\x00\xff\xff\xff\xff"], ids=["no", "some"])
def test_bytes_that_are_no_message_are_an_error_of_the_projects_own(topic: str, raw: bytes) -> None:
    collector = heard([configuration_message(), *pendulum_messages()])
    before = collector.results()[0]

    with pytest.raises(ActuatedCharactersError):
        collector.take(topic, raw, 0)

    assert collector.results()[0] == before


def test_diagnostics_that_are_none_are_left_out_for_any_node_may_have_sent_them() -> None:
    collector = heard([configuration_message(), *pendulum_messages()])
    before = collector.results()[0]

    collector.take(topics.DIAGNOSTICS.name, b"\x00\x01\x00\x00\xff\xff\xff\xff", 0)

    assert collector.results()[0] == before
