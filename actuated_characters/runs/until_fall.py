"""A run in this process until its character fell, from a keyframe in memory on; leaves no bag."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from actuated_characters.metrics.collector import MetricsCollector
from actuated_characters.runs.held_signals import signals_held
from actuated_characters.runs.in_process import run_made
from actuated_characters.runs.plan import RunPlan
from msgs_config.bus.composition import UNTIL_A_MESSAGE, ComposableNode, Turns
from msgs_config.bus.in_process import Bus, InProcessNode
from msgs_config.bus.node import BusNode, Executor, StopFlag
from msgs_config.errors import RunError
from msgs_config.messages import topics
from msgs_config.messages.clock import FIRST_TICK, TickClock
from msgs_config.messages.keyframe import decode_keyframe, write_keyframe
from msgs_config.messages.session import SESSION, make_session
from msgs_config.shared_parameters import KEYFRAME_BUDGET, KEYFRAME_PERIOD, RESUME_FROM

_LOOK_TICKS = 24  # between looks at whether it has fallen
_MOST_KB = 1_000_000  # of keyframes a second of simulated time: they stay in memory
_KEYFRAME = topics.KEYFRAME.of(topics.SIM_NODE)
_CONTROLLER_KEYFRAME = topics.CONTROLLER_KEYFRAME.of(topics.CONTROLLER_NODE)


@dataclass(frozen=True)
class Keyframe:
    """All that a run goes on from in a state."""

    tick: int  # of the state
    simulator: bytes
    controller: bytes

    @property
    def size(self) -> int:
        """In bytes."""
        return len(self.simulator) + len(self.controller)


@dataclass(frozen=True)
class Sender:
    """A node that sends what a run is sent, and subscribes to the states when all is there."""

    name: str
    make: Callable[[BusNode], ComposableNode]
    parameters: Mapping[str, object]


@dataclass(frozen=True)
class Ended:
    """What a run has shown."""

    fell: bool | None  # None: not known, as of a fixed base
    fell_tick: int | None  # from whose state on it was down
    keyframes: Sequence[Keyframe]  # of states in which it was not down, the first one first


def run_until_fall(
    plan: RunPlan,
    sender: Sender | None,
    folder: Path,
    *,
    begin: Keyframe | None = None,
    first_tick: int = FIRST_TICK,
    keyframe_period: float = 0.0,
    changed: Mapping[str, object] | None = None,
) -> Ended:
    """Run a plan until its character fell, or for all its ticks.

    Args:
        plan: Its ticks count from the first state of this run.
        sender: Who sends what it is sent; none if it is sent nothing.
        folder: Where keyframes are written for the nodes that read them.
        begin: What it goes on from; else the plan's own start.
        first_tick: That of the first state, where there is no keyframe.
        keyframe_period: Of the keyframes that it leaves, s; 0: none.
        changed: Parameters of the controller that are others than the plan's.

    Raises:
        ActuatedCharactersError: one of the nodes failed.
        KeyboardInterrupt: it was interrupted by a signal, whose own handler raised nothing.
    """
    own: dict[str, object] = {
        SESSION.name: make_session(f"/{topics.SIM_NODE}"),
        KEYFRAME_PERIOD.name: keyframe_period,
        KEYFRAME_BUDGET.name: _MOST_KB,
    }
    simulator = {**plan.simulator, **own, "wait_for_subscribers": 2 + (sender is not None)}
    controller = {**plan.controller, **(changed or {}), **own, "wait_for_subscribers": 2}
    if begin is not None:
        first_tick = begin.tick
        file = write_keyframe(folder, topics.SIM_NODE, begin.simulator)
        simulator[RESUME_FROM.name] = file
        file = write_keyframe(folder, topics.CONTROLLER_NODE, begin.controller)
        controller[RESUME_FROM.name] = file
    bus = Bus(lambda name, severity, sentence: None)
    listener = _Listener(bus.node("listener", {}))
    places, makers = [], dict[str, Callable[[BusNode], ComposableNode]]()
    if sender is not None:
        session = {SESSION.name: own[SESSION.name]}
        places.append(bus.node(sender.name, {**sender.parameters, **session}))
        makers[sender.name] = sender.make
    places.append(bus.node(topics.CONTROLLER_NODE, controller))
    places.append(bus.node(topics.SIM_NODE, simulator))
    with signals_held(most=2) as stop:
        run_made(listener, places, makers, stop)
    if stop:
        raise KeyboardInterrupt
    return listener.ended(TickClock(plan.simulation.rate_hz), first_tick)


class _Listener(ComposableNode):
    """Measures a run as a recorder does, keeps its keyframes, and ends it when it has fallen."""

    def __init__(self, node: InProcessNode) -> None:
        super().__init__(node)
        self._collector = MetricsCollector()
        self._simulator: dict[int, bytes] = {}  # keyframes by stamp, ns
        self._controller: dict[int, bytes] = {}
        for topic in topics.TABLE:
            for each in topic.as_others_name_it if topic.is_measured else ():
                node.listen(each, partial(self._measure, each.name))
        node.listen(_KEYFRAME, partial(_keep, self._simulator))
        node.listen(_CONTROLLER_KEYFRAME, partial(_keep, self._controller))

    def _measure(self, topic: str, raw: bytes) -> None:
        self._collector.take(topic, raw, None)

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Wait until it has fallen, or `stop`."""
        del executor
        next_look = 0
        while not stop:
            tick = self._collector.last_tick
            if tick >= next_look:
                next_look = tick + _LOOK_TICKS
                if tick and self._collector.has_fallen():
                    return
            yield UNTIL_A_MESSAGE

    def ended(self, clock: TickClock, first_tick: int) -> Ended:
        """What the run, which is over and began with a tick's state, has shown.

        Raises:
            RunError: it was not measured to its end.
        """
        if self._collector.missing_ticks:
            raise RunError("a tick was not measured")
        figures, series = self._collector.results()
        fell, fell_at, is_down = figures["fell"], figures["fell_at_s"], series["is_down"]
        assert fell is None or isinstance(fell, bool)
        assert fell_at is None or isinstance(fell_at, float)
        keyframes = [
            Keyframe(tick, raw, self._controller[stamp_ns])
            for stamp_ns, raw in self._simulator.items()
            if stamp_ns in self._controller
            for tick in (clock.tick(stamp_ns),)
            if first_tick < tick <= first_tick + len(is_down)
            and is_down[tick - first_tick - 1] != 1.0
        ]
        after = None if fell_at is None else round(fell_at * clock.rate_hz)
        return Ended(fell, None if after is None else first_tick + after, keyframes)


def _keep(keyframes: dict[int, bytes], raw: bytes) -> None:
    keyframes[decode_keyframe(raw).stamp_ns] = raw
