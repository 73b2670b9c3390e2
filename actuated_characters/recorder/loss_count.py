"""Counts the messages of a topic that never came. No ROS in here."""

from collections.abc import Callable


class LossCount:
    """Finds gaps in the numbers that each publisher gives its own messages: 1, 2, 3 and so on.

    The numbers do not say which publisher they are of. A number that follows none of the last ones
    is the first of another publisher as long as there have been more publishers than are known, and
    comes after a gap otherwise. Messages before the first number that came are not missed.
    """

    def __init__(self, count_publishers: Callable[[], int]) -> None:
        """`count_publishers` says how many there have been, whether or not they are still there.

        It is asked only where a number does not follow.
        """
        self._count_publishers = count_publishers
        self._last: list[int] = []  # each publisher's last number, the most recent one at the end
        self.lost_messages = 0

    def take(self, number: int | None) -> None:
        """Take the number of a message as it came; None where the middleware has none."""
        if number is None:
            return
        last = self._last
        if last and last[-1] == number - 1:  # the usual case: nothing is lost
            last[-1] = number
            return
        self._remove_predecessor(number)
        last.append(number)

    def _remove_predecessor(self, number: int) -> None:
        """Forget the last number of the publisher whose next one is this; count the gap."""
        last = self._last
        if number - 1 in last:
            last.remove(number - 1)
            return
        if len(last) < max(self._count_publishers(), 1):
            return  # the number is of a new publisher
        before = max((known for known in last if known < number), default=None)
        if before is None:  # the number is of a publisher that started over
            last.pop(0)
            return
        last.remove(before)
        self.lost_messages += number - before - 1
