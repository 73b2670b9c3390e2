"""What a fork sends: the recorded inputs, as far as they are repeated, and the new ones."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from actuated_characters.bags.keyframes import KeyframePlace
from actuated_characters.bags.recording import Recording, read_recordings
from actuated_characters.fork.inputs import ForkPoint, Stop, Stops, recorded_stops
from actuated_characters.replay.comparison import clock_of, first_tick_of
from actuated_characters.replay.players.simulator_outputs import read_rare_messages
from actuated_characters.runs.planned.behaviours import read_behaviours
from actuated_characters.runs.planned.files import Planned
from actuated_characters.runs.planned.pins import read_pins
from actuated_characters.runs.planned.strengths import read_strengths
from actuated_characters.runs.planned.throws import read_throws
from actuated_characters.runs.planned.wrenches import read_pushes
from msgs_config.messages import topics
from msgs_config.messages.session import GivenSession
from msgs_config.settings import Settings, parameter

PACE = "real_time_factor"
"""The simulator's parameter of how fast it goes."""

_LATEST = 2**62  # ns


class ForkSettings(Settings):
    """Which run is forked where, and what is new from there on."""

    recording: str = parameter("", "the bag, or the directory of its run")
    stamp_ns: int = parameter(
        0, "of the keyframe that the recording is read from; 0: all", maximum=_LATEST
    )
    log_time_ns: int = parameter(0, "of that keyframe in the bag", maximum=_LATEST)
    row: int = parameter(0, "state from which on the fork differs, the first one being 0")
    ticks: int = parameter(1, "length of what is repeated and of what is new")
    later_inputs: bool = parameter(True, "repeat what was sent from that state on, too")
    settings: str = parameter("{}", "new parameters of nodes from that state on, JSON by node")
    file: str = parameter("pushes.json", "new pushes, as a run writes them")
    throws: str = parameter("throws.json", "new throws, as a run writes them")
    pins: str = parameter("", "new pins, as a run writes them; empty: none")
    strengths: str = parameter("", "new strengths, as a run writes them; empty: none")
    behaviours: str = parameter("", "new behaviours, as a run writes them; empty: none")
    wait_for_subscribers: int = parameter(1, "begin when this many subscribe to external_wrench")
    throw_subscribers: int = parameter(1, "likewise to throw")
    pin_subscribers: int = parameter(1, "likewise to pin")
    strength_subscribers: int = parameter(1, "likewise to controller_node/strength")
    behaviour_subscribers: int = parameter(1, "likewise to controller_node/behaviour")
    session: GivenSession = GivenSession()


@dataclass(frozen=True)
class Script:
    """What a run is sent that begins as a recording does, and how far it is compared with that."""

    recording: Recording
    first_tick: int  # of row 0
    row: int  # the last state that is compared; -1: none
    stops: Stops
    requests: Mapping[int, Sequence[tuple[str, bytes]]]  # topic and message, as those of a bag


def read_script(settings: ForkSettings) -> Script:
    """The script of a fork: what is recorded, as far as it is repeated, and what is new.

    Raises:
        ActuatedCharactersError: the recording cannot be repeated.
    """
    path, row = Path(settings.recording), settings.row
    stamp_ns, log_time_ns = settings.stamp_ns, settings.log_time_ns
    begin = KeyframePlace(stamp_ns, log_time_ns) if stamp_ns else None
    recording = read_recordings(path, begin)[0]
    point = ForkPoint(row, settings.ticks, settings.later_inputs)
    rare = read_rare_messages(path, recording).requests
    requests = {row: rare[row] for row in rare if point.repeats(row)}
    stops = recorded_stops(recording, point)
    script = Script(recording, first_tick_of(recording), row, stops, requests)
    _add_new(script, settings)
    return script


def _add_new(script: Script, settings: ForkSettings) -> None:
    """Add the new inputs to stops: parameters at the fork, others in their episode.

    From the fork on the simulator has the recorded pace, unless there is a new one.
    """
    stops, row, new = script.stops, script.row, json.loads(settings.settings)
    pace = float(script.recording.parameters.get(PACE) or 0.0)
    clock = clock_of(script.recording)
    if controller := new.get(topics.CONTROLLER_NODE):
        stops[row].settings.append((topics.CONTROLLER_NODE, controller))
    simulator = ({PACE: pace} if pace else {}) | new.get(topics.SIM_NODE, {})
    if simulator:  # its parameters count from the tick on that begins in the state
        stops[row + 1].settings.append((topics.SIM_NODE, simulator))
    begins = [row, *(each for each, stop in stops.items() if stop.resets)]

    def stop_of(planned: Planned) -> Stop:
        at = clock.tick(planned.stamp_ns) - script.first_tick
        return stops[max(begin for begin in begins if begin <= at) + 1]

    if settings.strengths:
        stops[row].strengths += read_strengths(Path(settings.strengths))
    if settings.behaviours:
        stops[row].behaviours += read_behaviours(Path(settings.behaviours))
    for push in read_pushes(Path(settings.file)):
        stop_of(push).pushes.append(push)
    for pin in read_pins(Path(settings.pins)) if settings.pins else ():
        stop_of(pin).pins.append(pin)
    for throw in read_throws(Path(settings.throws)):
        stop_of(throw).throws.append(throw)
