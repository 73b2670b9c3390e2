"""The pins of a recording: what changed when, and which of the applied wrenches were theirs."""

from dataclasses import replace

from actuated_characters.bags.recording import Recording
from msgs_config.messages.pins import LET_GO, PinArrays
from msgs_config.messages.wrenches import WrenchArrays


def own_pushes(recording: Recording, tick: int) -> WrenchArrays | None:
    """The pushes of a tick, by its row, without the pins' forces; None where no message came."""
    applied = recording.applied_wrench[tick] if recording.applied_wrench else None
    pins = recording.pins[tick + 1] if recording.pins else None
    if applied is None or pins is None:
        return applied
    count = len(applied.links) - len(pins.links)  # the pins' forces are the last ones
    return replace(
        applied,
        links=applied.links[:count],
        wrenches=applied.wrenches[:count],
        points=applied.points[:count],
    )


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
