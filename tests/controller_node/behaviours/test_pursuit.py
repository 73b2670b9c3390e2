"""The behaviour `pursuit`: where it draws a character, when it strikes, what it refuses."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from controller_node.behaviours.base import BehaviourOutput, Observation
from controller_node.behaviours.factory import choose_behaviour
from controller_node.behaviours.pursuit import Pursuit
from controller_node.parameters import make_gains, resolve_for
from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from tests.support.physics import character

HUMANOID = character("humanoid")
REST = np.array(HUMANOID.rest_position)
STILL = np.zeros(HUMANOID.layout.size)
PERIOD = 1.0 / 240
FORCE = 300.0  # N
STIFFNESS = 4000.0  # N/m, of the root
TURN_SPEED = 3.0  # rad/s
STRIKES = ["kick", "spinkick"]
GIVEN = {"behaviour": "pursuit", "opponent": "other", "pursuit.force": FORCE, "recovery": "ramp"}


def values_of(given: Mapping[str, object], whole: Character = HUMANOID) -> Values:
    return resolve_for(whole, {**GIVEN, **given})


class Fighter:
    """A humanoid at rest, whose behaviour sees an opponent somewhere."""

    def __init__(self, **given: object) -> None:
        values = values_of({name.replace("__", "."): each for name, each in given.items()})
        choice = choose_behaviour(HUMANOID, values)
        behaviour = choice.make()
        assert isinstance(behaviour, Pursuit)
        assert (choice.needs_contacts, choice.opponent) == (True, "other")
        self.behaviour, self._gains = behaviour, make_gains(HUMANOID, values)
        self.position, self.tick = REST.copy(), 0

    def sees(self, x: float, y: float, z: float = 0.88) -> BehaviourOutput:
        """The output of the next tick."""
        rest = ReferenceState(HUMANOID.layout.configuration(REST), STILL, STILL)
        seen = Observation(
            time=self.tick * PERIOD,
            next_time=(self.tick + 1) * PERIOD,
            position=self.position,
            velocity=STILL,
            contacts=np.zeros((len(HUMANOID.links), 6)),
            now=rest,
            upcoming=rest,
            gains=self._gains,
            whole_gains=self._gains,
            strengths=np.ones(len(HUMANOID.vector_names)),
            assisted=True,
            opponent=np.array((x, y, z)),
        )
        self.tick += 1
        output = self.behaviour.advance(seen)
        assert output.target is not None
        self.target = output.target.state_at(seen.time, rest).configuration
        return output

    @property
    def lead(self) -> FloatArray:
        """From the body's root to the target's, m."""
        return self.target.position[:2] - self.position[:2]

    @property
    def turned(self) -> float:
        """The target's turn about z, from facing along x, in rad."""
        return self.behaviour.carry.turn


@pytest.mark.parametrize("angle", np.linspace(-3.0, 3.0, 7))
def test_the_root_is_drawn_towards_the_opponent_by_the_force(angle: float) -> None:
    fighter = Fighter()

    fighter.sees(4.0 * math.cos(angle), 4.0 * math.sin(angle))

    # stable PD's stiffness times the error
    np.testing.assert_allclose(
        STIFFNESS * fighter.lead, [FORCE * math.cos(angle), FORCE * math.sin(angle)], atol=1e-9
    )


def test_it_turns_to_the_opponent_no_faster_than_it_may() -> None:
    fighter, turns = Fighter(), []
    for _ in range(240):
        fighter.sees(0.0, 4.0)
        turns.append(fighter.turned)

    np.testing.assert_allclose(np.diff(turns[:100]), TURN_SPEED * PERIOD)
    assert turns[-1] == pytest.approx(0.5 * math.pi)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Ground that is higher by 0.6 m from x = 1 m on, below a roof."""
    path = tmp_path_factory.mktemp("terrain") / "table.yaml"
    path.write_text(
        "boxes: [{at: [3, 0], size: [4, 4, 0.6]}, {at: [0, 0, 2.5], size: [9, 9, 0.1]}]"
    )
    return str(path)


@pytest.mark.parametrize(("height", "way"), [(1.0, -1.0), (1.48, 1.0)])
def test_an_opponent_is_down_by_its_height_over_its_ground(
    height: float, way: float, table: str
) -> None:
    fighter = Fighter(terrain=table)

    fighter.sees(1.9, 0.0, height)

    assert np.sign(fighter.lead[0]) == way


def test_on_a_table_it_is_drawn_as_high_but_not_at_once(table: str) -> None:
    fighter, heights = Fighter(terrain=table), []
    for _ in range(10):
        fighter.sees(4.0, 0.0, 1.48)
    on_ground = fighter.target.position[2]
    fighter.position[0], fighter.position[2] = 1.5, REST[2] + 0.6
    for _ in range(480):
        fighter.sees(4.0, 0.0, 1.48)
        heights.append(fighter.target.position[2] - on_ground)

    assert on_ground == pytest.approx(REST[2])  # the roof is no ground
    assert heights[-1] == pytest.approx(0.6)
    assert np.diff(heights).max() < 0.003  # m a tick


@pytest.mark.parametrize(
    ("distance", "height", "way"), [(1.9, 0.4, -1.0), (2.1, 0.4, 1.0), (1.9, 0.88, 1.0)]
)
def test_it_goes_away_from_an_opponent_that_is_down_and_near(
    distance: float, height: float, way: float
) -> None:
    fighter = Fighter()

    fighter.sees(distance, 0.0, height)

    assert STIFFNESS * fighter.lead[0] == pytest.approx(way * FORCE)


def test_it_strikes_in_reach_with_one_clip_after_the_other() -> None:
    fighter, struck = Fighter(strike__clips=STRIKES, strike__reach=0.9), []
    for _ in range(6 * 240):
        facts = fighter.sees(0.85, 0.0).phase.facts
        if facts.get("to") == "clip" and struck[-1:] != [facts["clip"]]:
            struck.append(facts["clip"])

    assert struck[:3] == [*STRIKES, STRIKES[0]]


@pytest.mark.parametrize(("distance", "height"), [(0.95, 0.88), (0.85, 0.4)])
def test_it_strikes_neither_out_of_reach_nor_whoever_is_down(
    distance: float, height: float
) -> None:
    fighter = Fighter(strike__clips=STRIKES, strike__reach=0.9)

    assert all(fighter.sees(distance, 0.0, height).phase.mode.value == "TRACK" for _ in range(240))


def test_at_the_opponents_very_place_it_stays_finite() -> None:
    fighter = Fighter()

    fighter.sees(*fighter.position[:2])

    assert np.isfinite(fighter.target.position).all()


def test_a_strike_begins_without_a_jump_of_the_target() -> None:
    fighter = Fighter(strike__clips=STRIKES, strike__reach=0.9)
    fighter.sees(2.0, 0.0)
    before = fighter.target

    fighter.sees(0.85, 0.0)

    step = HUMANOID.layout.difference(before, fighter.target)
    assert np.abs(step).max() < 0.05


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"opponent": ""}, "needs an 'opponent'"),
        ({"planner": "predictive"}, "'planner' must be none"),
        ({"strike.clips": ["kik"]}, "'strike.clips': 'kik'; did you mean 'kick'"),
    ],
)
def test_what_it_cannot_do_is_refused(given: dict[str, object], reason: str) -> None:
    with pytest.raises(ConfigurationError, match=reason):
        choose_behaviour(HUMANOID, values_of(given))


def test_a_fixed_base_pursues_nobody() -> None:
    arm = character("franka_panda")

    with pytest.raises(ConfigurationError, match="fixed base"):
        choose_behaviour(arm, values_of({}, arm))
