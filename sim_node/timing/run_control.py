"""Whether the simulation goes on: pause, single steps, faults."""

from msgs_config.errors import CommandError


class RunControl:
    """Runs, is paused, or takes a number of steps and is paused again."""

    def __init__(self) -> None:
        self.paused = False
        self.fault: str | None = None
        self.steps_left = 0
        self.quits = False  # the node ends in good order
        self.has_diverged = False  # the state is of no use any more: only a reset helps

    @property
    def runs(self) -> bool:
        """Whether ticks go on."""
        return not self.paused or self.steps_left > 0

    def pause(self, fault: str | None = None, *, diverged: bool = False) -> None:
        """Stop before the next tick; `diverged` if the state can only be reset."""
        self.paused, self.steps_left = True, 0
        self.fault = fault or self.fault
        self.has_diverged = self.has_diverged or diverged

    def resume(self) -> None:
        """Go on. Raises CommandError if the simulation has diverged."""
        self._check_sound()
        self.paused, self.steps_left, self.fault = False, 0, None

    def begin_steps(self, count: int) -> None:
        """Take some steps, then pause again. Raises CommandError unless paused and not diverged."""
        self._check_sound()
        if not self.paused:
            raise CommandError("not paused; ~/step is for a simulation that is")
        if self.steps_left:
            raise CommandError(f"{self.steps_left} steps of another call are not done yet")
        self.steps_left, self.fault = count, None

    def tick(self) -> bool:
        """Count a tick that is over; whether it was the last of the steps."""
        if self.steps_left == 0:
            return False
        self.steps_left -= 1
        return self.steps_left == 0

    def reset(self) -> None:
        """A new episode begins: no fault is left, and no step. What was paused stays so."""
        self.steps_left, self.fault, self.has_diverged = 0, None, False

    def _check_sound(self) -> None:
        if self.has_diverged:
            raise CommandError(f"cannot go on, only ~/reset: {self.fault}")
