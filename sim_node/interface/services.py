"""The simulator's services: pause, single steps, and a new episode."""

from collections.abc import Callable

from msgs_config.bus.node import Answer, BusNode, Executor
from msgs_config.errors import CommandError
from sim_node.timing.run_control import RunControl


class Services:
    """Offers `~/pause`, `~/step` and `~/reset`; all take effect between two ticks."""

    def __init__(
        self,
        node: BusNode,
        control: RunControl,
        step_ticks: Callable[[], int],
        resume: Callable[[], None],
        reset: Callable[[], None],
    ) -> None:
        """`step_ticks` says how many ticks a call of `~/step` is.

        `resume` asks for the present tick's commands again, `reset` begins an episode.
        """
        self._control = control
        self._step_ticks = step_ticks
        self._resume = resume
        self._reset = reset
        self._steps: Answer | None = None  # answer to the call whose steps are not done yet
        node.offer("pause", self._on_pause, takes_flag=True)
        node.offer("step", self._on_step)
        node.offer("reset", self._on_reset)

    def end_steps(self, reason: str = "") -> None:
        """Answer a call of `~/step`, if there is one; `reason` is empty if its steps are done."""
        steps, self._steps = self._steps, None
        if steps is not None:
            steps.give(not reason, reason or f"{self._stepped} ticks done")

    def end(self, executor: Executor) -> None:
        """Answer all open calls; the simulation ends."""
        self.end_steps("the simulation ends")
        executor.serve_pending()  # the last step may have been the run's last tick

    def pause(self) -> None:
        """Stop before the next tick."""
        self._control.pause()
        self.end_steps("paused before")

    def resume(self) -> None:
        """Go on. Raises CommandError if the simulation has diverged."""
        if self._control.paused:
            self._control.resume()
            self.end_steps("resumed before")
            self._resume()

    def step(self, ticks: int) -> Answer:
        """Take ticks; the answer is given when they are done, or something has ended them.

        Raises:
            CommandError: it is not paused, has diverged, or others are not done yet.
        """
        self._control.begin_steps(ticks)
        answer = self._steps = Answer()
        self._stepped = ticks
        self._resume()  # it may end the steps at once
        return answer

    def reset(self) -> None:
        """Begin a new episode; a paused simulator stays paused."""
        self._control.reset()
        self.end_steps("reset before")
        self._reset()

    def _on_pause(self, pauses: bool) -> Answer:
        try:
            if pauses:
                self.pause()
            else:
                self.resume()
        except CommandError as error:
            return Answer(False, str(error))
        return Answer(True, "paused" if self._control.paused else "running")

    def _on_step(self, _: bool) -> Answer:
        try:
            return self.step(self._step_ticks())
        except CommandError as error:
            return Answer(False, str(error))

    def _on_reset(self, _: bool) -> Answer:
        self.reset()
        return Answer(True, "a new episode, paused" if self._control.paused else "a new episode")
