"""When the simulator waits for slow subscribers. That it helps is in `test_recorder.py`."""

from sim_node.timing.flow_control import FlowControl


class Subscribers:
    """Acknowledge, or do not."""

    def __init__(self) -> None:
        self.have_all = True
        self.waits: list[float] = []  # s that each question may take
        self.lines: list[str] = []  # logged

    def __call__(self, seconds: float) -> bool:
        self.waits.append(seconds)
        return self.have_all


def pressure_of(subscribers: Subscribers) -> FlowControl:
    return FlowControl(
        subscribers, subscribers.lines.append, every_ticks=100, longest=1.0, turn=0.5
    )


def test_subscribers_that_follow_are_asked_only_now_and_then() -> None:
    subscribers = Subscribers()
    pressure = pressure_of(subscribers)

    delays = [pressure.holds(tick, now=0.0) for tick in range(1, 301)]

    assert not any(delays)
    assert len(subscribers.waits) == 3


def test_it_holds_until_they_have_all() -> None:
    subscribers = Subscribers()
    pressure = pressure_of(subscribers)
    subscribers.have_all = False

    delays = [pressure.holds(tick, now=5.0) for tick in range(1, 101)]

    assert delays == [False] * 99 + [True]
    assert pressure.holds(100, now=5.9)
    subscribers.have_all = True
    assert not pressure.holds(100, now=5.95)
    assert not subscribers.lines
    assert subscribers.waits == [0.5, 0.5, 0.5]


def test_who_never_acknowledges_is_waited_for_once() -> None:
    subscribers = Subscribers()
    pressure = pressure_of(subscribers)
    subscribers.have_all = False

    assert pressure.holds(100, now=5.0)
    assert not pressure.holds(100, now=6.0)
    assert not any(pressure.holds(tick, now=7.0) for tick in range(101, 400))
    assert subscribers.waits == [0.5, 0.5, 0.0, 0.0]
    (line,) = subscribers.lines
    assert "within 1 s" in line


def test_who_has_caught_up_is_waited_for_again() -> None:
    subscribers = Subscribers()
    pressure = pressure_of(subscribers)
    subscribers.have_all = False
    assert pressure.holds(100, now=5.0)
    assert not pressure.holds(100, now=6.0)

    subscribers.have_all = True
    assert not pressure.holds(200, now=7.0)
    subscribers.have_all = False

    assert pressure.holds(300, now=8.0)
    assert pressure.holds(300, now=8.9)
    assert not pressure.holds(300, now=9.0)
