"""Driving a character that is steered: arrow keys, and a button to hold, publish `cmd_vel`.

viser tells when a key goes down, and again while the system repeats it, but not when it goes up:
so a press lasts until the repeats end. Of several keys that are held, only the last one is
repeated; its repeats keep what the others have said, too.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import viser
from rclpy.node import Node

from actuated_characters.viewer.controls.actions import ActionQueue
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.node import Publisher
from msgs_config.messages import topics, typed

_WALK, _RUN, _BACK, _TURN = 1.0, 2.2, -0.4, 0.8  # m/s and rad/s that keys ask for
_PERIOD = 0.1  # s between two velocities
# A press lasts so long, s: systems begin to repeat it after up to 0.66 s.
_FIRST_PRESS, _REPEATED_PRESS = 0.7, 0.4
_SEARCH_PERIOD = 1.0  # s between looks for a controller that is steered
_HELP = (
    "**↑ ↓ ← →** walk and turn, with **Shift** run, **space** stops. When the keys, or the button, "
    "are let go, the character stops."
)


@dataclass(frozen=True)
class Velocity:
    """A velocity in the character's own frame."""

    forward: float = 0.0  # m/s
    left: float = 0.0  # m/s
    turn: float = 0.0  # rad/s, to the left

    def encode(self) -> bytes:
        """The serialised message of `cmd_vel`."""
        twist = typed.new(typed.TWIST)
        twist.linear.x, twist.linear.y, twist.angular.z = self.forward, self.left, self.turn
        return typed.encode(twist)


@dataclass(frozen=True)
class Key:
    """What a key says; None of what it leaves as it is."""

    label: str
    key: Literal["arrowup", "arrowdown", "arrowleft", "arrowright", "space"]
    modifier: Literal["shift"] | None = None
    forward: float | None = None  # m/s
    turn: float | None = None  # rad/s


KEYS = (
    Key("Walk", "arrowup", forward=_WALK),
    Key("Run", "arrowup", "shift", forward=_RUN),
    Key("Walk backward", "arrowdown", forward=_BACK),
    Key("Walk backward", "arrowdown", "shift", forward=_BACK),
    Key("Turn left", "arrowleft", turn=_TURN),
    Key("Turn left, running", "arrowleft", "shift", turn=_TURN),
    Key("Turn right", "arrowright", turn=-_TURN),
    Key("Turn right, running", "arrowright", "shift", turn=-_TURN),
    Key("Stop", "space", forward=0.0, turn=0.0),
    Key("Stop, running", "space", "shift", forward=0.0, turn=0.0),
)


@dataclass(frozen=True)
class DrivingInput:
    """The velocity that is asked for, until a time in s by a steady clock."""

    velocity: Velocity = Velocity()
    until: float = -math.inf
    key: Key | None = None  # the key that was pressed last; `pressed` says when
    pressed: float = -math.inf

    def press(self, key: Key, now: float) -> "DrivingInput":
        """What is asked for by a key that goes down, or is repeated."""
        before = self.velocity if now < self.until else Velocity()
        forward = before.forward if key.forward is None else key.forward
        if key.modifier is None and key.forward is None and forward == _RUN:
            forward = _WALK  # Shift was let go
        turn = before.turn if key.turn is None else key.turn
        is_repeated = key == self.key and now - self.pressed < _REPEATED_PRESS
        until = now + (_REPEATED_PRESS if is_repeated else _FIRST_PRESS)
        return DrivingInput(Velocity(forward, 0.0, turn), until, key, now)

    def hold(self, velocity: Velocity, now: float) -> "DrivingInput":
        """What is asked for by the button, ten times a second while it is down."""
        return DrivingInput(velocity, now + _REPEATED_PRESS)


class DrivingControls:
    """A folder of the panel; hidden where no controller takes velocities."""

    def __init__(self, node: Node, gui: viser.GuiApi, actions: ActionQueue) -> None:
        self._node, self._gui, self._actions = node, gui, actions
        self._below: str | None = None  # the namespace of the character that is driven, if any
        self._publisher: Publisher | None = None  # publishes that character's velocity
        self._publishers: dict[str, Publisher] = {}  # those of all driven characters, by namespace
        self._commands: list[viser.CommandHandle] = []
        self._input = DrivingInput()
        self._moves = False  # whether the last velocity that was published is not zero
        self._next_search = self._next_velocity = 0.0  # s
        self._folder = gui.add_folder("Drive", visible=False)
        with self._folder:
            gui.add_markdown(_HELP)
            self._sliders: list[Any] = [
                gui.add_slider("Ahead (m/s)", -0.6, 2.5, 0.1, initial_value=_WALK),
                gui.add_slider("Left (m/s)", -0.3, 0.3, 0.05, initial_value=0.0),
                gui.add_slider("Turn (rad/s)", -1.0, 1.0, 0.05, initial_value=0.0),
            ]
            button = gui.add_button("Hold to drive", hint="at the velocities of the sliders")
        button.on_hold(self._later(self._hold_button), callback_hz=1.0 / _PERIOD)

    def _later(self, function: Callable[[float], None]) -> Callable[..., Any]:
        """A callback of viser that has the node's thread call a function with the time of it."""

        async def change(event: object) -> None:
            del event
            self._actions.put(partial(function, time.monotonic()))

        return change

    def _hold_button(self, now: float) -> None:
        self._input = self._input.hold(Velocity(*(slider.value for slider in self._sliders)), now)

    def _press(self, key: Key, now: float) -> None:
        self._input = self._input.press(key, now)

    def update(self, below: str | None) -> None:
        """Be about the character in a namespace, or about none; publish what is asked for."""
        now = time.monotonic()
        if below != self._below or now >= self._next_search:
            self._next_search = now + _SEARCH_PERIOD
            self._choose(below)
        if self._publisher is None or now < self._next_velocity:
            return
        velocity = self._input.velocity if now < self._input.until else Velocity()
        if self._moves or velocity != Velocity():  # only the first of several zeros is sent
            self._publisher.publish(velocity.encode())
            self._next_velocity = now + _PERIOD
        self._moves = velocity != Velocity()

    def _choose(self, below: str | None) -> None:
        """Open the topic of a character that is steered, and show the controls; or close both."""
        is_steered = below is not None and self._is_steered(below)
        if below == self._below and is_steered == self._folder.visible:
            return
        self._close()
        self._below, self._folder.visible = below, is_steered
        if below is not None and is_steered:
            if below not in self._publishers:
                topic = replace(topics.CMD_VEL, name=f"{below}/{topics.CMD_VEL.name}")
                self._publishers[below] = create_publisher(self._node, topic)
            self._publisher = self._publishers[below]
            self._commands = [self._add_command(key) for key in KEYS]

    def _is_steered(self, below: str) -> bool:
        """Whether the controller of a character subscribes to velocities."""
        found = self._node.get_subscriptions_info_by_topic(f"{below}/{topics.CMD_VEL.name}")
        return any(
            (each.node_namespace.rstrip("/"), each.node_name) == (below, topics.CONTROLLER_NODE)
            for each in found
        )

    def _close(self) -> None:
        """Stop what was driven."""
        if self._publisher is not None and self._moves:
            self._publisher.publish(Velocity().encode())
        for command in self._commands:
            command.remove()
        self._publisher, self._commands = None, []
        self._input, self._moves = DrivingInput(), False

    def _add_command(self, key: Key) -> viser.CommandHandle:
        command = self._gui.add_command(key.label, hotkey=key.key, modifier=key.modifier)
        command.on_trigger(self._later(partial(self._press, key)))
        return command
