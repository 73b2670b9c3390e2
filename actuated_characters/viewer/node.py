"""`viewer`: shows characters in a browser; subscribes like any other node, and delays none."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rclpy.node import Node

from actuated_characters.render.drawn_shapes import drawn_shapes
from actuated_characters.render.skin.choosing import skin_of
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.skin.palette import color_number
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.hands import Hands
from actuated_characters.viewer.controls.panel import ControlPanel, Subject
from actuated_characters.viewer.controls.shown_parameters import (
    ShownParameter,
    check_settings,
    shown_parameters,
)
from actuated_characters.viewer.drawing.live_character import LiveCharacter
from actuated_characters.viewer.drawing.scene import WORLD, BrowserScene, DrawnBalls
from actuated_characters.viewer.drawing.terrain import draw_terrain
from actuated_characters.viewer.parameters import PARAMETERS, ViewerSettings
from actuated_characters.viewer.simulators import WatchedNamespace, WatchedSimulators
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import (
    describe_address,
    open_socket,
    start_server,
    stop_server,
)
from msgs_config.arrays import FloatArray
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.bus.polling import PollingExecutor
from msgs_config.bus.ros_parameters import declare, given_parameters
from msgs_config.character.layout import ROOT
from msgs_config.character.model import Character
from msgs_config.errors import ActuatedCharactersError, SkinError
from msgs_config.messages import topics
from msgs_config.parameters import resolve
from msgs_config.runtime.process import StopSignal

_SEARCH_PERIOD = 1.0  # s between looks for simulators
_FIRST_SEARCH_PERIOD = 0.2  # s between looks for simulators, while none is known
_IDLE_PERIOD = 0.1  # s between looks for clients
_LEAST_REST = 0.003  # s of rest after a picture, for the threads that send it
_LEAF = "character"  # below a namespace's name in the scene, where there may be other namespaces


class ViewerNode(Node):
    """Draws the newest state of every character, at most so many times a second."""

    def __init__(self, **options: Any) -> None:
        """Open the server; `options` are rclpy's own of every node.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or the port cannot be listened on.
        """
        super().__init__(topics.VIEWER_NODE, **options)
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        settings = ViewerSettings.of(values)
        self._period = 1.0 / settings.fps
        check_settings(settings)
        self._skin = _read_skin(settings)
        self._once_logger = OnceLogger(self.get_logger())
        host = settings.host
        self._rejections = Rejections()
        listening = open_socket(host, settings.port or None)
        self._server = start_server(listening, RequestCheck(host), self._rejections.note)
        self._scene = BrowserScene(self._server)
        self._actions = ActionQueue()
        self._hands = Hands(self, self._scene, self._actions)
        self._settings = settings
        self._panel = ControlPanel(
            self, self._server.gui, self._scene, self._hands, self._actions, settings
        )
        self._simulators = WatchedSimulators(self, self.get_namespace().rstrip("/"), self._log)
        self._drawn: dict[str, LiveCharacter] = {}
        self._numbers: dict[str, int] = {}  # of characters in their order, by their namespaces
        self._parameters: dict[str, Mapping[str, tuple[ShownParameter, ...]]] = {}
        self._balls: dict[str, DrawnBalls] = {}
        # by names in the scene: texts of URDFs, and the corners (k, 3), m
        self._terrains: dict[str, tuple[str, FloatArray]] = {}
        self._framed: set[str] = set()  # the characters, by namespace, that the camera was set for
        self._announce(host, listening.getsockname()[1])

    def _announce(self, host: str, port: int) -> None:
        address, *warnings = describe_address(host, port)
        print(address, flush=True)
        for warning in warnings:
            self.get_logger().warning(warning)

    def run(self, stop: StopSignal) -> None:
        """Draw until `stop`."""
        executor = PollingExecutor(self, service_period=_IDLE_PERIOD)
        next_search = before = 0.0
        try:
            while not stop:
                now = time.monotonic()
                if now >= next_search:
                    found = bool(self._simulators.characters)
                    next_search = now + (_SEARCH_PERIOD if found else _FIRST_SEARCH_PERIOD)
                    self._search()
                is_watched = bool(self._server.get_clients())
                self._update(is_watched=is_watched, seconds=now - before)
                before = now
                executor.serve()  # when no message waits to be drawn: it would take those first
                rest = (self._period if is_watched else _IDLE_PERIOD) - (time.monotonic() - now)
                time.sleep(max(rest, _LEAST_REST))
        finally:
            self._simulators.watch(watches=False)
            stop_server(self._server)
            executor.close()

    def _search(self) -> None:
        self._simulators.find_simulators()
        for watched in self._simulators.gone():
            self._remove(watched.below)
            self._forget_world(watched.simulator)
        for sentence in self._rejections.take():
            self.get_logger().warning(sentence)

    def _update(self, *, is_watched: bool, seconds: float) -> None:
        """Bring the scene to the newest states; `seconds` since the last call."""
        for watched in self._simulators.changed():
            self._rebuild(watched)
        for watched in self._simulators.characters:
            if watched.is_new_episode and watched.below in self._drawn:
                self._drawn[watched.below].begin_episode()
        self._simulators.watch(watches=is_watched)
        self._actions.run()
        self._show_panel()
        if not is_watched:
            return
        with self._server.atomic():
            for watched in self._simulators.characters:
                self._draw(watched)
            for simulator, reader in self._simulators.balls.items():
                if simulator not in self._balls:
                    name = f"{WORLD}/balls{simulator}"
                    self._balls[simulator] = DrawnBalls(self._scene.api, name)
                self._balls[simulator].draw(*reader.take())
            self._hands.pull(self._drawn, self._stamps_ns())
            self._scene.follow_characters(list(self._drawn.values()), seconds)
            self._frame_new_characters()

    def _frame_new_characters(self) -> None:
        """Have the cameras see all characters, once those that have come have been drawn."""
        drawn = {below for below, each in self._drawn.items() if each.has_been_drawn}
        if drawn == set(self._drawn) and not drawn <= self._framed:
            self._framed |= drawn
            corners = [corners for _, corners in self._terrains.values()]
            self._scene.frame_characters(list(self._drawn.values()), corners)

    def _draw(self, watched: WatchedNamespace) -> None:
        if watched.is_new_episode and watched.simulator in self._balls:
            self._balls[watched.simulator].remove()
        drawn = self._drawn.get(watched.below)
        if drawn is not None:
            drawn.shows = self._panel.shows
        if drawn is not None and watched.reader is not None and watched.reader.take():
            drawn.draw(watched.reader.sample)

    def _show_panel(self) -> None:
        """Have the panel be about the characters that are seen."""
        known = {
            each.below: Subject(
                self._drawn[each.below].character.name,
                each.simulator,
                each.below,
                each.readers_session,
                self._parameters[each.below],
            )
            for each in self._simulators.characters
            if each.below in self._drawn and each.reader is not None
        }
        samples = {
            each.below: each.reader.sample
            for each in self._simulators.characters
            if each.reader is not None
        }
        self._panel.update(known, self._stamps_ns())
        self._panel.show_curves(self._drawn, samples)

    def _stamps_ns(self) -> dict[str, int]:
        """Stamps of the newest states, by the characters' namespaces."""
        states = {
            each.below: each.reader.sample.state
            for each in self._simulators.characters
            if each.reader is not None
        }
        return {below: state.stamp_ns for below, state in states.items() if state is not None}

    def _rebuild(self, watched: WatchedNamespace) -> None:
        """Draw a character as it is described now; one that a restart left as it was stays."""
        rebuilt, before = watched.rebuilt, self._drawn.get(watched.below)
        assert rebuilt is not None
        if before is not None and before.take(rebuilt):
            return
        self._remove(watched.below)
        below = watched.below
        name = f"{WORLD}/characters{below}/{_LEAF}"
        bind = self._hands.bind(below, lambda: self._drawn.get(below))
        self._hands.open_topics(below, watched.simulator)
        drives_root = ROOT in rebuilt.known.parameters.get("commanded_joints", [ROOT])
        self._parameters[below] = shown_parameters(
            rebuilt.character, self._settings.controls, drives_root=drives_root
        )
        try:
            with self._server.atomic():
                number = self._number_of(watched)
                skin = self._skin_of(rebuilt.character)
                self._drawn[below] = LiveCharacter(
                    self._scene.api, name, rebuilt, bind, number, skin
                )
                self._draw_terrain(watched)
        except ActuatedCharactersError as error:
            self._log(f"'{rebuilt.character.name}' cannot be drawn: {error}")

    def _number_of(self, watched: WatchedNamespace) -> int:
        """Which colours a character has: its team's in its world, or the next ones if alone."""
        assert watched.rebuilt is not None
        alone = self._numbers.setdefault(watched.below, len(self._numbers))
        return color_number(watched.rebuilt.world, alone)

    def _draw_terrain(self, watched: WatchedNamespace) -> None:
        """Draw the ground of a character's world as it is described now."""
        assert watched.rebuilt is not None
        terrain, name = watched.rebuilt.world.terrain, _terrain_name(watched.simulator)
        text = "" if terrain is None else terrain.urdf_text
        if text == (self._terrains[name][0] if name in self._terrains else ""):
            return
        self._remove_terrain(name)
        if terrain is not None:
            self._terrains[name] = text, draw_terrain(self._scene.api, name, terrain)

    def _skin_of(self, character: Character) -> GivenSkin | None:
        """The skin that is given, if it fits a character, which has its own one else."""
        if self._skin is not None:
            try:
                skin_of(character, drawn_shapes(character), self._skin)
            except SkinError as error:
                self._log(f"'{character.name}' has its own skin: {error}")
                return None
        return self._skin

    def _forget_world(self, simulator: str) -> None:
        """Remove terrain and balls of a simulator that has no characters any more."""
        if any(each.simulator == simulator for each in self._simulators.characters):
            return
        self._remove_terrain(_terrain_name(simulator))
        if (balls := self._balls.pop(simulator, None)) is not None:
            balls.remove()

    def _remove_terrain(self, name: str) -> None:
        if self._terrains.pop(name, None) is not None:
            self._scene.api.remove_by_name(name)

    def _remove(self, below: str) -> None:
        if (drawn := self._drawn.pop(below, None)) is not None:
            drawn.remove()

    def _log(self, sentence: str) -> None:
        self._once_logger.log_once(sentence)


def _read_skin(settings: ViewerSettings) -> GivenSkin | None:
    if not settings.skin:
        return None
    return GivenSkin.read(
        Path(settings.skin), Path(settings.skin_map) if settings.skin_map else None
    )


def _terrain_name(simulator: str) -> str:
    """The name in the scene of the terrain in a simulator's world."""
    return f"{WORLD}/terrain{simulator}/shapes"
