"""The node that sends what was planned for a run: its parameters, and whether all was accepted."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from actuated_characters.recorder.run_directory import PARAMETERS, read_metrics
from actuated_characters.runs.planned.files import Planned, write_planned
from msgs_config.errors import RunError


def plan_senders(
    directory: Path,
    inputs: Mapping[str, Sequence[Planned]],
    recording: Mapping[str, object],
    fork: Mapping[str, object] | None,
) -> dict[str, dict[str, object]]:
    """The parameters of the node that sends what was planned, by its name; none if nothing was."""
    if not any(inputs.values()) and fork is None:
        return {}
    planned = _write_planned(directory, inputs, recording)
    return {"pusher": planned} if fork is None else {"fork": {**planned, **fork}}


def _write_planned(
    directory: Path,
    inputs: Mapping[str, Sequence[Planned]],
    recording: Mapping[str, object],
) -> dict[str, object]:
    """Write what was planned; returns the parameters of the process that sends it.

    It waits for the node that it is for, and for a recorder that keeps the topic in a bag.
    """
    excluded = recording.get("exclude", ())
    assert isinstance(excluded, Collection)
    left_out = {str(name).removeprefix("/") for name in excluded}

    def subscribers(topic: str) -> int:
        return 2 if recording["write_bag"] and topic not in left_out else 1

    files = {what: directory / PARAMETERS / f"{what}.json" for what in inputs}
    for what, planned in inputs.items():
        write_planned(files[what], planned)
    steers = bool(inputs["velocities"])
    return {
        "file": str(files["pushes"]),
        "throws": str(files["throws"]),
        **({"velocities": str(files["velocities"])} if steers else {}),
        "wait_for_subscribers": subscribers("external_wrench"),
        "throw_subscribers": subscribers("throw"),
        **({"velocity_subscribers": subscribers("cmd_vel_stamped")} if steers else {}),
    }


def check_recorded(directory: Path, ticks: int, counts: Mapping[str, int]) -> None:
    """Raise RunError unless the recorder has all ticks, and all inputs were accepted.

    `counts` are the numbers of inputs, where they are known. A reset is a tick without figures.
    """
    recorded, _ = read_metrics(directory)
    if recorded["ticks"] != ticks:
        raise RunError(f"{recorded['ticks']} of {ticks} ticks were recorded")
    for what in ("pushes", "throws"):
        if counts.get(what, 1) and (rejected := recorded[f"rejected_{what}"]):
            of = f"of {counts[what]} " if what in counts else ""
            raise RunError(f"sim_node rejected {rejected} {of}{what}")
