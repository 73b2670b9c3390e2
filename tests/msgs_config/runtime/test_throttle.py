"""Throttled messages: one a period, the last one in any case, of several nodes the same."""

from msgs_config.runtime.throttle import THROTTLED_RATE, Throttle


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_of_many_messages_a_second_one_a_period_is_chosen() -> None:
    clock = Clock()
    throttle = Throttle(clock)
    chosen = 0
    for _ in range(3000):
        chosen += throttle.chooses()
        clock.now += 1.0 / 3000.0
    assert abs(chosen - THROTTLED_RATE) <= 1


def test_messages_that_come_seldom_are_all_chosen() -> None:
    clock = Clock()
    throttle = Throttle(clock)
    for _ in range(20):
        assert throttle.chooses()
        assert not throttle.makes_up()
        clock.now += 1.5 / THROTTLED_RATE


def test_the_last_message_is_made_up_once_when_no_other_follows() -> None:
    clock = Clock()
    throttle = Throttle(clock)
    assert throttle.chooses()
    assert not throttle.chooses()
    assert not throttle.makes_up()  # another one may follow
    clock.now += 2.5 / THROTTLED_RATE
    assert throttle.makes_up()
    assert not throttle.makes_up()


def test_two_nodes_choose_messages_of_the_same_tick() -> None:
    clock = Clock()
    simulator, controller = Throttle(clock), Throttle(clock)
    pairs = []
    for _ in range(5000):
        first = simulator.chooses()
        clock.now += 0.00002  # the message is on its way
        pairs.append((first, controller.chooses()))
        clock.now += 0.00038
    together = sum(first and second for first, second in pairs)
    alone = sum(first and not second for first, second in pairs)
    assert together > 0.8 * THROTTLED_RATE * 2.0  # of 2 s
    assert alone < 0.1 * THROTTLED_RATE * 2.0  # where a period ends between the two
