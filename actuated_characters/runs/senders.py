"""The node that sends what was planned for a run: its parameters, and whether all was accepted."""

from collections.abc import Collection, Mapping
from pathlib import Path

from actuated_characters.recorder.run_directory import PARAMETERS, read_metrics
from actuated_characters.runs.planned.files import write_planned
from actuated_characters.runs.planned.inputs import PlannedInputs
from msgs_config.errors import RunError
from msgs_config.messages.topics import JOINT_STATES


def plan_senders(
    directory: Path,
    inputs: PlannedInputs,
    recording: Mapping[str, object],
    fork: Mapping[str, object] | None,
    *,
    simulator_waits: bool = False,
) -> dict[str, dict[str, object]]:
    """The parameters of the node that sends what was planned, by its name; none if nothing was.

    The controller waits for it; if `simulator_waits`, the simulator does: a foreign controller may
    answer at once.
    """
    if not any(inputs.by_name().values()) and fork is None:
        return {}
    planned = _write_planned(directory, inputs, recording)
    if simulator_waits:
        planned["heard_by"] = JOINT_STATES.name
    return {"pusher": planned} if fork is None else {"fork": {**planned, **fork}}


def _write_planned(
    directory: Path,
    inputs: PlannedInputs,
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

    by_name = inputs.by_name()
    files = {what: directory / PARAMETERS / f"{what}.json" for what in by_name}
    for what, planned in by_name.items():
        write_planned(files[what], planned)
    steers, weakens, holds = bool(inputs.velocities), bool(inputs.strengths), bool(inputs.pins)
    asks = bool(inputs.behaviours)
    return {
        "file": str(files["pushes"]),
        "throws": str(files["throws"]),
        **({"velocities": str(files["velocities"])} if steers else {}),
        **({"strengths": str(files["strengths"])} if weakens else {}),
        **({"pins": str(files["pins"])} if holds else {}),
        **({"behaviours": str(files["behaviours"])} if asks else {}),
        "wait_for_subscribers": subscribers("external_wrench"),
        "throw_subscribers": subscribers("throw"),
        "pin_subscribers": subscribers("pin"),
        **({"velocity_subscribers": subscribers("cmd_vel_stamped")} if steers else {}),
        **({"strength_subscribers": subscribers("controller_node/strength")} if weakens else {}),
        **({"behaviour_subscribers": subscribers("controller_node/behaviour")} if asks else {}),
    }


def check_recorded(directory: Path, ticks: int, inputs: PlannedInputs | None) -> None:
    """Raise RunError unless the recorder has all ticks, and all inputs were accepted.

    `inputs` are None where their number is not known. A reset is a tick without figures.
    """
    recorded, _ = read_metrics(directory)
    if recorded["ticks"] != ticks:
        raise RunError(f"{recorded['ticks']} of {ticks} ticks were recorded")
    for what in ("pushes", "throws", "pins"):
        sent = None if inputs is None else len(inputs.by_name()[what])
        if sent != 0 and (rejected := recorded[f"rejected_{what}"]):
            of = "" if sent is None else f"of {sent} "
            raise RunError(f"sim_node rejected {rejected} {of}{what}")
