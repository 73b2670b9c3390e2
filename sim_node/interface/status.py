"""What the diagnostics say of one character."""

from sim_node.interface.character_interface import CharacterInterface
from sim_node.timing.lockstep import CommandStatus
from sim_node.timing.zero_order_hold import ZeroOrderHold

_MS = 1e-6  # of a nanosecond


def report(port: CharacterInterface) -> dict[str, object]:
    """Counts of commands by verdict, of pushes and of saturations; the age of the commands."""
    collector, actor = port.collector, port.actor
    values: dict[str, object] = {
        verdict.value: collector.counts[verdict] for verdict in CommandStatus
    }
    for verdict in ("accepted", "rejected"):
        values[f"{verdict}_pushes"] = port.push_counts[verdict]
    values |= port.foreign_counts
    values["saturated_ticks"] = sum(int(count) for count in actor.saturated_ticks)
    saturated = actor.saturated_ticks > 0
    names = [n for n, yes in zip(actor.character.vector_names, saturated, strict=True) if yes]
    if names:
        values["saturated"] = " ".join(names)
    if isinstance(collector, ZeroOrderHold):
        values["command_timeouts"] = collector.timeouts
        age_ns = collector.age_ns
        values["command_age_ms"] = "none" if age_ns is None else round(_MS * age_ns, 3)
    return values
