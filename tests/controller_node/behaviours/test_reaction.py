"""Reactions to balls that hit a walking humanoid: what leads to what, and that it comes back."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import pytest

from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.plan import make_plan
from controller_node.behaviours.base import Mode, ModeReport
from controller_node.behaviours.compliance import ComplianceProfile, softened
from controller_node.control_laws import GainArrays, TrackingInput
from controller_node.controller import Controller
from controller_node.references.clip import ClipReference
from controller_node.references.trajectory import points_of_lists
from controller_node.references.transformed import PlanarTransform
from controller_node.strength import strengths_of
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from tests.support.physics import controller
from tests.support.struck import HUMANOID, LINKS, RATE_HZ, ProjectileThrow, Run, driver, run

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

LAYOUT = HUMANOID.layout
CLOCK = TickClock(RATE_HZ)
WEIGHT = 9.81 * HUMANOID.mass
HIT, SPEED = 480, 10.0  # tick, m/s
FROM_FRONT = np.pi
THRESHOLD = 30.0  # N s, beyond which it goes limp
SECONDS = 3.3  # until who was hit a bit tracks again


@lru_cache
def walk(impulse: float, behaviour: str = "reactive", seconds: float = SECONDS) -> Run:
    """A walk with a ball of so many N s that is thrown against the chest."""
    throw = ProjectileThrow(SPEED, HIT, direction=FROM_FRONT)
    given = {"clip": "walk", "behaviour": behaviour}
    return run(given, round(seconds * RATE_HZ), (throw,), mass=impulse / SPEED)


@lru_cache
def unhit(behaviour: str = "tracking", seconds: float = SECONDS) -> Run:
    return run({"clip": "walk", "behaviour": behaviour}, round(seconds * RATE_HZ))


def errors(whole: Run, first: int = 0) -> FloatArray:
    """Mean error (t,) of the joints, rad, from a tick on; from behind if it is below zero."""
    means = []
    positions = whole.positions[:-1]  # the last one has no reference
    for position, reference in zip(positions[first:], whole.references[first:], strict=True):
        wanted = LAYOUT.configuration(reference.position)
        apart = LAYOUT.difference(wanted, LAYOUT.configuration(position))
        means.append(LAYOUT.norms(apart)[2:].mean())
    return np.array(means)


@lru_cache
def usual_error() -> float:
    """That of a walk that nothing hits, in the mean, rad."""
    return float(errors(unhit()).mean())


def excess_steps(whole: Run) -> FloatArray:
    """Steps of the target beyond its velocity times h, of the worst rotation, (t,) degrees."""
    steps = [0.0]
    for before, after in zip(whole.references, whole.references[1:], strict=False):
        moved = LAYOUT.difference(
            LAYOUT.configuration(before.position), LAYOUT.configuration(after.position)
        )
        beyond = LAYOUT.norms(moved - before.velocity / RATE_HZ)
        steps.append(float(np.degrees(beyond[1:].max())))  # without the root's place
    return np.array(steps)


def tick_of(whole: Run, mode: Mode) -> int:
    return whole.tick_of(next(r for r in whole.modes if r.phase.mode is mode))


def reports(whole: Run, mode: Mode) -> list[ModeReport]:
    return [report for report in whole.modes if report.phase.mode is mode]


# Before a hit


def test_an_active_ragdoll_is_plain_tracking_to_the_bit_until_its_torque_is_bounded() -> None:
    nominal, active = unhit(), unhit("active_ragdoll")
    torques = np.linalg.norm(nominal.efforts[:, 3:6], axis=1)
    bounded = int(np.argmax(torques > 150.0))

    assert bounded > 0 and torques[bounded] > 150.0
    assert active.efforts[:bounded].tobytes() == nominal.efforts[:bounded].tobytes()
    assert np.linalg.norm(active.efforts[bounded, 3:6]) == pytest.approx(150.0)
    assert active.mode_names() == ["TRACK"]


@pytest.mark.parametrize("clip", ["getup_faceup", "getup_facedown", "roll", "backflip"])
def test_what_lies_or_turns_over_as_its_clip_does_has_not_fallen(clip: str) -> None:
    ticks = round((read_clip(HUMANOID, clip).times[-1] + 0.25) * RATE_HZ)
    whole = run({"clip": clip, "behaviour": "reactive", "library": ["walk"]}, ticks)

    assert whole.mode_names() == ["TRACK"]


def test_what_falls_without_a_hit_goes_limp_and_lies_in_no_other_mode() -> None:
    given = {"clip": "walk", "behaviour": "reactive", "root_assistance": False}
    whole = run(given, 2 * RATE_HZ)

    assert whole.mode_names() == ["TRACK", "LIMP", "SEARCH", "BLEND"]
    assert whole.modes[1].phase.facts["why"] == "fallen"
    assert whole.positions[whole.tick_of(whole.modes[1]), 2] > 0.1
    assert {report.phase.facts["assistance"] for report in whole.modes} == {"none"}


def test_until_the_hit_it_is_plain_tracking_to_the_bit_and_then_it_is_not() -> None:
    nominal, reactive = walk(20.0, "tracking", 2.5), walk(20.0)
    react = tick_of(reactive, Mode.REACT)

    assert HIT < react < HIT + 15
    assert reactive.efforts[:react].tobytes() == nominal.efforts[:react].tobytes()
    assert (reactive.efforts[react] != nominal.efforts[react]).any()


def test_the_loop_in_one_process_hands_the_contacts_on() -> None:
    settings = {"behaviour": "reactive"}
    given = {"reference": "clip", "clip": "walk"}
    plans = [make_plan("humanoid", 0.2, given, {}, own) for own in (settings, {})]

    reactive, nominal = (list(ticks_in_process(plan)) for plan in plans)

    for one, other in zip(reactive, nominal, strict=True):
        assert one.following.position.tobytes() == other.following.position.tobytes()


# The reaction


def test_a_hit_leads_through_all_modes_back_to_tracking() -> None:
    whole = walk(20.0)

    assert whole.mode_names() == ["TRACK", "REACT", "SEARCH", "BLEND", "BLEND", "TRACK"]
    react, search, onto, back = whole.modes[1:5]
    assert react.phase.facts["link"] == "chest"
    assert search.phase.facts["impulse"] == pytest.approx(20.0, rel=0.1)
    assert whole.tick_of(onto) == whole.tick_of(search) + 1
    assert onto.phase.facts["distance"] < onto.phase.facts["median_distance"]
    assert [onto.phase.facts["to"], back.phase.facts["to"]] == ["clip", "reference"]


@pytest.mark.parametrize("impulse", [10.0, 20.0])
def test_the_target_never_steps(impulse: float) -> None:
    steps = excess_steps(walk(impulse))

    # a clip's own velocity jumps at its frames
    assert steps.max() < 2.0
    for report in walk(impulse).modes[1:]:
        tick = walk(impulse).tick_of(report)
        assert steps[tick - 1 : tick + 2].max() < 0.5


def test_while_it_reacts_the_root_has_no_more_than_a_fifth_of_the_weight() -> None:
    whole = walk(20.0)
    react, blend = tick_of(whole, Mode.REACT), tick_of(whole, Mode.BLEND)

    forces = np.linalg.norm(whole.efforts[:, :3], axis=1)
    assert forces[react:blend].max() <= 0.2 * WEIGHT + 1e-9
    assert forces[:react].max() > 0.3 * WEIGHT
    assert forces[blend : blend + 60].max() > 0.2 * WEIGHT


def test_it_is_back_on_the_clip_three_seconds_after_20_newton_seconds() -> None:
    whole = walk(20.0, seconds=6.5)
    since = tick_of(whole, Mode.REACT) + 3 * RATE_HZ

    assert whole.mode_names()[-1] == "TRACK"
    assert whole.tick_of(whole.modes[-1]) < since
    assert errors(whole, since).mean() < 1.2 * usual_error()
    clip = ClipReference(LAYOUT, read_clip(HUMANOID, "walk"))
    last = len(whole.references) - 1
    own = clip.sample(last / RATE_HZ).configuration.position
    assert whole.references[last].position == pytest.approx(own, abs=1e-6)  # time went on


@pytest.mark.parametrize(("duration", "impulse"), [(0.1, 3.5), (0.05, 5.0), (0.01, 20.0)])
def test_one_hit_has_one_reaction_however_short(duration: float, impulse: float) -> None:
    given = {"clip": "walk", "behaviour": "reactive", "react.duration": duration}
    if impulse > 10.0:
        given["limp.threshold"] = 1e4  # of which it is a slight one
    throw = ProjectileThrow(SPEED, 240, direction=FROM_FRONT)

    whole = run(given, 300, (throw,), mass=impulse / SPEED)

    assert whole.mode_names() == ["TRACK", "REACT", "SEARCH", "BLEND"]
    assert whole.tick_of(whole.modes[2]) - whole.tick_of(whole.modes[1]) >= RATE_HZ / 60
    assert whole.modes[2].phase.facts["impulse"] == pytest.approx(impulse, rel=0.2)


def test_a_harder_hit_while_it_reacts_makes_it_go_limp() -> None:
    slow, fast = (
        ProjectileThrow(speed, tick, direction=FROM_FRONT)
        for speed, tick in ((5.0, 240), (20.0, 250))
    )

    whole = run({"clip": "walk", "behaviour": "reactive"}, 300, (slow, fast), mass=2.0)

    assert whole.mode_names() == ["TRACK", "REACT", "LIMP"]
    facts = whole.modes[-1].phase.facts
    assert facts["why"] == "hit" and facts["impulse"] >= THRESHOLD


def test_the_response_grows_with_the_impulse() -> None:
    nominal = unhit().positions
    peaks = []
    for impulse in (5.0, 10.0, 20.0, 40.0):
        apart = walk(impulse).positions[:, :3] - nominal[:, :3]
        peaks.append(float(np.linalg.norm(apart[: HIT + 300], axis=1).max()))

    assert peaks[0] > 0.005
    assert peaks == sorted(peaks)
    assert peaks[3] > 0.5


# Limp, and up again


def test_limp_nothing_drives_it() -> None:
    whole = walk(40.0)
    limp = tick_of(whole, Mode.LIMP)

    assert reports(whole, Mode.LIMP)[0].phase.facts["why"] == "hit"
    assert reports(whole, Mode.LIMP)[0].phase.facts["impulse"] >= THRESHOLD
    assert not whole.efforts[limp : limp + 200].any()
    assert excess_steps(whole)[limp] < 2.0


def is_back(modes: Sequence[ModeReport], stamp_ns: int) -> bool:
    """Whether it has been tracking for a while again."""
    tracks = len(modes) > 1 and modes[-1].phase.mode is Mode.TRACK
    return tracks and stamp_ns - modes[-1].stamp_ns > 0.5e9


@lru_cache
def recovers(seed: int, behaviour: str, **given: object) -> Run:
    """A walk that a ball hits at some time, of some weight, from about the front or the back."""
    rng = np.random.default_rng(seed)
    tick = int(rng.integers(60, 300))
    direction = float(rng.choice([0.0, np.pi]) + rng.uniform(-0.6, 0.6))
    mass = float(rng.uniform(4.5, 7.0))
    return run(
        {"clip": "walk", "behaviour": behaviour, **given},
        tick + 8 * RATE_HZ,
        (ProjectileThrow(SPEED, tick, direction=direction),),
        mass=mass,
        is_over=is_back,
    )


def assert_got_up(whole: Run) -> None:
    """It lay on the ground, and at the end it follows its reference, upright."""
    heights = whole.positions[:, 2]
    assert Mode.LIMP in [report.phase.mode for report in whole.modes]
    assert heights.min() < 0.3
    assert whole.mode_names()[-1] == "TRACK"
    assert heights[-60:].min() > 0.7
    assert errors(whole, -60).mean() < 1.5 * usual_error()


@pytest.mark.parametrize(  # 3 lies longest; 8 lies on its face
    "seed", [3, 8, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in (0, 1, 6))]
)
def test_after_a_hard_hit_it_falls_lies_and_gets_up(seed: int) -> None:
    whole = recovers(seed, "reactive")

    assert_got_up(whole)
    up = next(r for r in whole.modes if "getup" in str(r.phase.facts.get("clip")))
    assert up.phase.facts["distance"] < up.phase.facts["median_distance"]


def test_it_goes_on_from_where_it_got_up() -> None:
    whole = recovers(1, "reactive")
    back = whole.tick_of(reports(whole, Mode.BLEND)[-1])

    # the target's root moves on at a walk's pace, and not back to where it would have been
    places = np.array([reference.position[:2] for reference in whole.references])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) * RATE_HZ
    assert speeds[back:].max() < 2.5


def test_a_mode_says_from_the_first_how_much_it_is_assisted() -> None:
    assert unhit("tracking").modes[0].phase.facts == {"assistance": "full"}
    told = [report.phase.facts["assistance"] for report in walk(20.0).modes]
    assert told == ["full", 0.2, 0.2, "full", "full", "full"]
    rising = recovers(1, "reactive").modes
    assert "rising" in [report.phase.facts["assistance"] for report in rising]


@pytest.mark.parametrize("recovery", ["clip", "ramp"])
def test_an_active_ragdoll_falls_lies_and_gets_up(recovery: str) -> None:
    assert_got_up(recovers(1, "active_ragdoll", recovery=recovery))


def test_with_a_planner_it_falls_lies_and_begins_to_rise_by_its_joints_alone() -> None:
    def rises(modes: Sequence[ModeReport], stamp_ns: int) -> bool:
        return modes[-1].phase.mode is Mode.BLEND and stamp_ns - modes[-1].stamp_ns > 0.3e9

    few = {"plan.samples": 12, "plan.horizon": 0.3, "plan.rounds": 1}
    whole = run(
        {"clip": "walk", "behaviour": "active_ragdoll", "planner": "predictive", **few},
        8 * RATE_HZ,
        (ProjectileThrow(SPEED, 60, direction=FROM_FRONT),),
        mass=6.0,
        is_over=rises,
    )

    limp, search = tick_of(whole, Mode.LIMP), tick_of(whole, Mode.SEARCH)
    assert [mode.phase.mode.value for mode in whole.modes[-3:]] == ["LIMP", "SEARCH", "BLEND"]
    assert not whole.efforts[limp : search + 1].any()
    assert not whole.efforts[:, :6].any()
    assert whole.efforts[search + 1 :].any(axis=1).all()
    assert {mode.phase.facts["assistance"] for mode in whole.modes} == {"none"}


def test_an_active_ragdoll_rides_out_a_light_hit_with_a_bounded_torque_on_its_root() -> None:
    whole = walk(20.0, "active_ragdoll", 4.5)

    assert whole.mode_names() == ["TRACK"]
    assert np.linalg.norm(whole.efforts[:, 3:6], axis=1).max() <= 150.0 + 1e-9


def states_at(driver: Controller, tick: int, first: bool = False) -> StampedState:
    """The state in which the driver's own reference begins, at a tick."""
    start = driver._own_reference.sample(0.0)
    effort = None if first else np.zeros(LAYOUT.size)
    return StampedState(CLOCK.stamp_ns(tick), start.configuration.position, start.velocity, effort)


def test_a_trajectory_leads_from_where_it_got_up_to_where_it_says() -> None:
    # Arrange: as after it got up elsewhere, and faces another way
    control, episode_ns = driver({"behaviour": "reactive"}), CLOCK.stamp_ns(1)
    nothing = np.zeros((len(LINKS), 6))
    control.compute_effort(states_at(control, 1, first=True), episode_ns, nothing)
    control._behaviour.carry = PlanarTransform(1.0, 3.0, -2.0)
    _, carried = control.compute_effort(states_at(control, 2), episode_ns, nothing)
    goal = np.array(HUMANOID.rest_position)
    goal[:2] = 7.0, 0.0
    points = points_of_lists(LAYOUT.dof_names, [0.5], [goal.tolist()], [[]], [[]])

    # Act
    start = CLOCK.stamp_ns(3)
    control.set_trajectory(points, start_ns=start, now_ns=start, episode_ns=episode_ns)
    tracked = [
        control.compute_effort(states_at(control, tick), episode_ns, nothing)[1].position
        for tick in range(3, 140)
    ]

    # Assert
    assert np.linalg.norm(carried.position[:2] - (3.0, -2.0)) < 0.1
    assert np.linalg.norm(tracked[0] - carried.position) < 0.05
    assert tracked[-1] == pytest.approx(goal, abs=1e-9)


# Parts


def test_strengths_and_gains_of_zero_count_while_it_gives_way() -> None:
    # Arrange
    off = {"gains.left_knee.p": 0.0, "gains.left_knee.d": 0.0}
    given = {"behaviour": "reactive", "strength.left_elbow": 0.5, **off}
    control, episode_ns = driver(given), CLOCK.stamp_ns(1)
    taken = strengths_of(LAYOUT, ("left_shoulder",), (0.0,), episode_ns)
    used: list[GainArrays] = []
    law = control._effort

    def watched(instant: TrackingInput, gains: GainArrays) -> FloatArray:
        used.append(gains)
        return law(instant, gains)

    control._effort = watched  # type: ignore[method-assign]
    hit = np.zeros((len(LINKS), 6))
    hit[LINKS.index("neck"), 0] = 2000.0

    # Act
    control.set_strengths(taken, episode_ns=episode_ns)
    control.compute_effort(states_at(control, 1, first=True), episode_ns, 0.0 * hit)
    control.compute_effort(states_at(control, 2), episode_ns, hit)

    # Assert
    assert control.mode is not None and control.mode.phase.mode is Mode.REACT
    heads = {joint.name: joint.start for joint in LAYOUT.joints}
    soft = {name: used[1].stiffness[head] for name, head in heads.items()}
    assert soft["left_elbow"] == pytest.approx(0.5 * soft["right_elbow"], rel=0.05)
    assert soft["left_knee"] == soft["left_shoulder"] == 0.0
    assert used[1].damping[heads["left_knee"]] == 0.0
    assert soft["right_knee"] > 0.0 and soft["right_shoulder"] > 0.0


def test_gains_by_inertia_keep_their_mean_and_make_all_joints_swing_alike() -> None:
    # Arrange
    model = DynamicsModel(HUMANOID)
    model.update(np.array(HUMANOID.rest_position), np.zeros(LAYOUT.size))
    diagonal = np.diag(model.mass_matrix())
    gains = driver({}).settings.gains
    joints = LAYOUT.joints[1:]

    # Act
    strengths = np.ones(len(LAYOUT.vector_starts))
    scaled = ComplianceProfile(HUMANOID, diagonal).gains(gains, strengths, 88.0, 77.0)

    # Assert: stiffness over inertia, the square of a frequency, is that of all
    squares = [scaled.stiffness[j.start] / diagonal[j.entries].mean() for j in joints]
    assert squares == pytest.approx([squares[0]] * len(joints))
    heads = [joint.start for joint in joints]
    assert scaled.stiffness[heads].mean() == pytest.approx(gains.stiffness[heads].mean())
    assert scaled.effort_limits[:2].tolist() == [88.0, 77.0]
    assert scaled.stiffness[:6].tolist() == gains.stiffness[:6].tolist()


def test_near_the_struck_link_joints_are_softest() -> None:
    names = HUMANOID.vector_names
    strengths = dict(zip(names, softened(HUMANOID, LINKS.index("left_wrist"), 0.2), strict=True))

    assert strengths["left_elbow"] == pytest.approx(0.2)  # the wrist is fixed to the forearm
    assert strengths["left_shoulder"] == pytest.approx(0.2 + 0.8 / 3.0)
    assert strengths["chest"] == pytest.approx(0.2 + 1.6 / 3.0)
    assert strengths["right_knee"] == strengths["root"] == strengths["root_r"] == 1.0


@pytest.mark.parametrize(
    ("name", "given", "word"),
    [
        ("humanoid", {"behaviour": "reactive", "hit.threshold": -1.0}, "hit.threshold"),
        ("humanoid", {"behaviour": "reactive", "hit.threshold": float("nan")}, "hit.threshold"),
        ("humanoid", {"behaviour": "reactive", "limp.threshold": 1.0}, "limp.threshold"),
        ("humanoid", {"behaviour": "reactive", "library": ["wlak"]}, "walk"),
        ("humanoid", {"behaviour": "reactive", "react.softness": 1.1}, "react.softness"),
        ("humanoid", {"behaviour": "active_ragdoll", "getup.faceup": "stand"}, "getup.faceup"),
        ("humanoid", {"behaviour": "ragdol"}, "did you mean 'ragdoll'"),
        ("laikago", {"behaviour": "reactive"}, "clip"),
        ("franka_panda", {"behaviour": "active_ragdoll"}, "fixed base"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(
    name: str, given: dict[str, object], word: str
) -> None:
    with pytest.raises(ActuatedCharactersError, match=word) as refused:
        controller(name, **given)
    assert "\n" not in str(refused.value)


def test_without_contacts_a_behaviour_that_needs_them_gives_no_answer() -> None:
    reactive = driver({"behaviour": "reactive"})
    plan = make_plan("humanoid", 0.1, {"reference": "clip"}, {}, {})
    first = next(iter(ticks_in_process(plan))).state

    with pytest.raises(ConfigurationError, match="contacts"):
        reactive.compute_effort(first, first.stamp_ns)
