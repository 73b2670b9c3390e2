"""Every documented command has a promise, and the cheap ones are run; see tests/documented."""

from pathlib import Path

import pytest

from tests.documented.collecting import collect, commands_of
from tests.documented.looking import Seen, broken
from tests.documented.promise import Promise, promise_of, read_promises
from tests.documented.trying import Reader

PLACES, PROMISES = collect(), read_promises()
CHEAP = [command for command, promise in PROMISES.items() if promise.cheap]


def test_every_documented_command_has_a_promise_and_every_promise_a_command() -> None:
    without = [command for command in PLACES if promise_of(command, PROMISES) is None]
    nowhere = PROMISES.keys() - PLACES.keys()

    assert without == [], "add what is seen of each to tests/documented/promises.yaml"
    assert nowhere == set(), (
        "no page, help or example has these commands: name each study in docs/lecture.md, and "
        "remove the other ones from tests/documented/promises.yaml"
    )


def test_what_others_need_is_known() -> None:
    from tests.documented.given import MAKERS

    needs = {need for promise in PROMISES.values() for need in promise.given}

    assert needs - PROMISES.keys() - MAKERS.keys() == set()


def test_a_block_is_its_lines_unless_one_runs_beside_others() -> None:
    assert commands_of("# a remark\n.venv/bin/one  a   # says\nmake \\\n  two\n") == [
        "one a",
        "make two",
    ]
    assert commands_of("one &\n.venv/bin/two\nkill %1\n") == ["one &\ntwo\nkill %1"]


@pytest.mark.parametrize(
    ("promise", "seen", "faults"),
    [
        (Promise(height=(0.7, 1.0), tilt=0.3, fell=False), Seen(0.9, 0.1, fell=False), 0),
        (Promise(height=(0.7, 1.0), tilt=0.3, fell=False), Seen(0.2, 1.5, fell=True), 3),
        (Promise(height=(0.7, 1.0)), Seen(), 1),
        (Promise(error=0.1, airborne=0.2), Seen(error=0.2, airborne=0.1), 2),
        (Promise(travels=(3.0, 5.0)), Seen(travelled=2.0), 1),
    ],
)
def test_a_promise_is_broken_by_what_is_seen(promise: Promise, seen: Seen, faults: int) -> None:
    assert len(broken(promise, seen, None)) == faults


def test_other_states_than_promised_are_a_fault() -> None:
    one, other = Seen(state_hash="a"), Seen(state_hash="b")

    assert broken(Promise(same_as="runs/demo"), one, one) == []
    assert len(broken(Promise(same_as="runs/demo"), one, other)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("command", CHEAP)
def test_a_cheap_command_does_what_it_says(command: str, tmp_path: Path) -> None:
    outcome = Reader(tmp_path, PROMISES).attempt(command)

    assert outcome.faults == ()
