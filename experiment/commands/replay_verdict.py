"""What the two ways of `replay` say of a run whose states came again."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # they take a second to import
    from experiment.bags.recording import Recording
    from experiment.replay.comparison import ReplayResult


def verdict(
    recordings: "Sequence[Recording]", result: "ReplayResult", tolerance: float | None, tail: str
) -> str:
    """What a replay has shown, in one line that ends with `tail`."""
    names = " and ".join(named(recording) for recording in recordings)
    episodes = f"{result.episodes} episode{'s' * (result.episodes != 1)}"
    head = f"{result.states} states of {names}, {episodes}"
    if tolerance is None:
        hashes = ", ".join(
            f"of {name} {digest}" if name else digest
            for name, digest in result.state_hashes.items()
        )
        return f"identical: {head}, state hash {hashes}; {tail}"
    largest = ", ".join(f"{value:.3g} {unit}" for unit, value in sorted(result.largest.items()))
    return f"within {tolerance:g}: {head}, largest differences {largest}; {tail}"


def named(recording: "Recording") -> str:
    """A recording's character, and its name where it has one."""
    character = recording.character.name
    return f"{recording.name} ({character})" if recording.name else character
