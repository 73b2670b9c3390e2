"""What the ways of `replay` say of a run whose states came again, or did not."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgs_config.errors import ReplayError
from msgs_config.versions import describe_changes, installed_versions

if TYPE_CHECKING:  # they take a second to import
    from actuated_characters.bags.recording import Recording
    from actuated_characters.replay.comparison import ReplayResult


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


def difference_error(
    bag: Path, recordings: "Sequence[Recording]", difference: object
) -> ReplayError:
    """An error of one line: what differs first, and which versions are others than then."""
    present = installed_versions()
    changes = dict.fromkeys(describe_changes(each.versions, present) for each in recordings)
    return ReplayError("; ".join(filter(None, [f"{bag}: {difference}", *changes])))


def named(recording: "Recording") -> str:
    """A recording's character, and its name where it has one."""
    character = recording.character.name
    return f"{recording.name} ({character})" if recording.name else character
