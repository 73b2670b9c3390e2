"""The pins of a recording: what changed when, and which of the applied wrenches were theirs."""

from dataclasses import replace

from actuated_characters.bags.recording import Recording
from msgs_config.messages.pins import LET_GO, PinArrays
from msgs_config.messages.wrenches import WrenchArrays


def own_pushes(recording: Recording, tick: int) -> WrenchArrays | None:
    """The pushes of a tick, by its row, without the pins' forces; None where no message came."""
    return _parted(recording, tick)[0]


def pin_forces(recording: Recording, tick: int) -> WrenchArrays | None:
    """The pins' forces in a tick, by its row, at their points; None where there was no pin."""
    return _parted(recording, tick)[1]


def _parted(recording: Recording, tick: int) -> tuple[WrenchArrays | None, WrenchArrays | None]:
    """The applied wrenches of a tick, in which the pins' forces are the last ones, in two."""
    applied = recording.applied_wrench[tick] if recording.applied_wrench else None
    pins = recording.pins[tick + 1] if recording.pins else None
    if applied is None or pins is None:
        return applied, None
    count = len(applied.links) - len(pins.links)
    pushes, forces = (
        replace(
            applied,
            links=applied.links[rows],
            wrenches=applied.wrenches[rows],
            points=applied.points[rows],
        )
        for rows in (slice(count), slice(count, None))
    )
    return pushes, forces


def pin_changes(recording: Recording, tick: int) -> PinArrays | None:
    """What changed the pins as a tick began, by its row, as a message; None if nothing did.

    It has the stamp of the state in which the tick begins. Each pin is there as it was in force, so
    its values are the simulator's, and a link that was let go has a force of 0.
    """
    if not recording.pins:
        return None
    before, after = ({} if each is None else each.rows for each in recording.pins[tick : tick + 2])
    changes = {link: LET_GO for link in before if link not in after}
    changes |= {link: row for link, row in after.items() if before.get(link) != row}
    return PinArrays.of_rows(int(recording.stamps_ns[tick]), changes) if changes else None
