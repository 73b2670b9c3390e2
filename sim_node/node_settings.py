"""What the parameters of `sim_node` say to the node itself, typed."""

from dataclasses import dataclass

from msgs_config.messages.clock import NANOSECONDS_PER_SECOND, TickClock
from msgs_config.messages.session import given_session
from msgs_config.parameters import Values
from sim_node.frames import FrameNames
from sim_node.sensors.readers import SensingSettings


@dataclass(frozen=True)
class NodeSettings:
    """All that the node depends on beside the simulation and its settings."""

    session: str  # empty: the node makes one
    is_realtime: bool  # the wall clock ends a tick, instead of the commands
    tick_period: float  # s of wall time from tick to tick; 0: as fast as it goes
    max_ticks: int  # 0: no limit
    wait_for_subscribers: int
    republish_period: float  # s of wall time
    lockstep_timeout: float  # s of wall time; 0: no limit
    on_timeout: str
    on_fault: str
    command_timeout_ns: int  # of simulated time
    push_ticks: int  # that a push lasts
    step_ticks: int  # of a call of `~/step`
    display_ticks: int  # between two messages for viewers
    frames: FrameNames
    clock: TickClock
    sensing: SensingSettings


def make_node_settings(values: Values) -> NodeSettings:
    """The settings of the node that the parameters' values say.

    Raises:
        ConfigurationError: the session is no session id, or a frame's name cannot be one.
    """
    rate = values.integer("rate")
    is_realtime = values.text("mode") == "realtime"
    factor = values.number("real_time_factor") or float(is_realtime)
    return NodeSettings(
        session=given_session(values),
        is_realtime=is_realtime,
        tick_period=1.0 / (factor * rate) if factor else 0.0,
        max_ticks=values.integer("max_ticks"),
        wait_for_subscribers=values.integer("wait_for_subscribers"),
        republish_period=values.number("republish_period"),
        lockstep_timeout=values.number("lockstep_timeout"),
        on_timeout=values.text("on_timeout"),
        on_fault=values.text("on_fault"),
        command_timeout_ns=round(values.number("command_timeout") * NANOSECONDS_PER_SECOND),
        push_ticks=max(round(values.number("wrench_duration") * rate), 1),
        step_ticks=values.integer("step_count"),
        display_ticks=max(round(rate / values.number("display_rate")), 1),
        frames=FrameNames.of(values),
        clock=TickClock(rate),
        sensing=SensingSettings(
            tick_s=1.0 / rate,
            gravity=values.number("gravity"),
            seed=values.integer("sensor_seed"),
        ),
    )
