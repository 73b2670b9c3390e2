"""The simulator's services: pause, single steps, and a new episode."""

from collections.abc import Callable

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from msgs_config.errors import CommandError
from msgs_config.runtime.polling import PollingExecutor
from sim_node.timing.run_control import RunControl


class Services:
    """Offers `~/pause`, `~/step` and `~/reset`; all take effect between two ticks."""

    def __init__(
        self,
        node: Node,
        control: RunControl,
        resume: Callable[[], None],
        reset: Callable[[], None],
    ) -> None:
        """`resume` asks for the present tick's commands again, `reset` begins an episode."""
        self._node = node
        self._control = control
        self._resume = resume
        self._reset = reset
        self._steps: Future | None = None  # of the reason that ended them
        node.create_service(SetBool, "~/pause", self._on_pause)
        # in another group: in the node's it would keep all others waiting until its steps are done
        group = ReentrantCallbackGroup()
        node.create_service(Trigger, "~/step", self._on_step, callback_group=group)
        node.create_service(Trigger, "~/reset", self._on_reset)

    def end_steps(self, reason: str = "") -> None:
        """Answer a call of `~/step`, if there is one; `reason` is empty if its steps are done."""
        if self._steps is not None:
            self._steps.set_result(reason)
            self._steps = None

    def end(self, executor: PollingExecutor) -> None:
        """Answer all open calls; the simulation ends."""
        self.end_steps("the simulation ends")
        executor.serve_pending()  # the last step may have been the run's last tick

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success = True
        if request.data:
            self._control.pause()
            self.end_steps("paused before")
        elif self._control.paused:
            try:
                self._control.resume()
            except CommandError as error:
                response.success, response.message = False, str(error)
                return response
            self.end_steps("resumed before")
            self._resume()
        response.message = "paused" if self._control.paused else "running"
        return response

    async def _on_step(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Answer when the steps are done, or when something has ended them."""
        count = int(self._node.get_parameter("step_count").value)
        try:
            self._control.begin_steps(count)
        except CommandError as error:
            response.success, response.message = False, str(error)
            return response
        self._steps = steps = Future()
        self._resume()
        reason = await steps
        response.success = not reason
        response.message = reason or f"{count} ticks done"
        return response

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._control.reset()
        self.end_steps("reset before")
        self._reset()
        response.success = True
        response.message = "a new episode, paused" if self._control.paused else "a new episode"
        return response
