"""What a replay needs of a recording, and what it can do without."""

from collections.abc import Iterator, Sequence

from actuated_characters.bags.recording import Recording
from actuated_characters.replay.commands import check_commands, has_commands
from actuated_characters.replay.comparison import Difference
from msgs_config.errors import RecordingError


def check_pushes(recording: Recording, rows: range) -> Iterator[str]:
    """Check that it is known which pushes acted in the ticks of these rows; yields notes.

    Raises:
        RecordingError: there were pushes, and it is not known.
    """
    of = _of(recording)
    if not recording.applied_wrench:
        if recording.pushes_sent:
            raise RecordingError(
                f"the recording has pushes{of} ({recording.pushes_sent} messages on "
                "'external_wrench'), but not which of them acted: nothing on 'applied_wrench'"
            )
        yield f"the recording has no 'applied_wrench'{of}: replayed without pushes"
    elif recording.pushes_sent:
        gaps = [row for row in rows if recording.applied_wrench[row] is None]
        if gaps:
            raise RecordingError(
                f"the recording lacks which pushes acted{of} in {len(gaps)} ticks, the first "
                f"time at {recording.stamps_ns[gaps[0] + 1]} ns: nothing on 'applied_wrench' there"
            )


def check_throws(recording: Recording) -> Iterator[str]:
    """Check that it is known what was thrown; yields notes.

    Raises:
        RecordingError: there were balls, and it is not known how they were thrown.
    """
    thrown = sum(map(len, recording.throws))
    balls = max((len(each.names) for each in recording.balls if each is not None), default=0)
    if balls > thrown:
        raise RecordingError(
            f"the recording has {balls} balls on 'thrown', but does not say how each was thrown: "
            f"{thrown} messages on 'applied_throw'"
        )
    if recording.throws_sent and not thrown:
        yield (
            f"the recording has {recording.throws_sent} messages on 'throw', and nothing on "
            "'applied_throw': replayed without balls"
        )


def first_uncommanded(recordings: Sequence[Recording]) -> tuple[Difference | None, list[str]]:
    """The first effort that no command can have led to, and notes on what could not be checked."""
    found: list[Difference] = []
    notes: list[str] = []
    for recording in recordings:
        if not recording.layout.size:
            continue
        if not has_commands(recording):
            notes.append(
                f"the recording has no commands{_of(recording)}: its efforts were compared with "
                "none"
            )
            continue
        check = check_commands(recording)
        if check.silent_stamps_ns:
            notes.append(
                f"the recording lacks commands{_of(recording)} for {len(check.silent_stamps_ns)} "
                f"states, the first at {check.silent_stamps_ns[0]} ns: what was applied there was "
                "compared with none"
            )
        if check.difference is not None:
            found.append(check.difference)
    return min(found, key=lambda difference: difference.tick, default=None), notes


def _of(recording: Recording) -> str:
    return f" of {recording.name}" if recording.name else ""
