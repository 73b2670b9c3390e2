"""The hands of those who watch: binds links in the scene, and publishes pushes and throws."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import viser
from rclpy.node import Node

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.touch import (
    STIFFNESS,
    Drag,
    aim_throw,
    pour_balls,
    spring_force,
)
from actuated_characters.viewer.drawing.drawn_character import Bind, LinkMesh
from actuated_characters.viewer.drawing.live_character import LiveCharacter
from actuated_characters.viewer.drawing.scene import WORLD, BrowserScene
from msgs_config.arrays import FloatArray
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.node import Publisher
from msgs_config.errors import CommandError
from msgs_config.messages import topics
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.throw import ProjectileThrow
from msgs_config.messages.topic import Topic
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches
from sim_node.physics.balls.throws import MOST_BALLS

_SPRING = (230, 60, 20)
_GRAVITY, _WRENCH_DURATION = 9.81, 0.1  # m/s^2, s: what simulators have by default


class Hands:
    """Drags and throws of all clients. Its methods are for the node's thread."""

    def __init__(self, node: Node, scene: BrowserScene, actions: ActionQueue) -> None:
        self.stiffness = STIFFNESS  # N/m
        self.ball_mass, self.ball_speed = 2.0, 8.0  # kg, m/s
        self.wrench_durations: dict[str, float] = {}
        """How long a push holds, s, by a simulator's namespace, where that is not as it began."""
        self._node, self._scene, self._actions = node, scene, actions
        self._publishers: dict[str, Publisher] = {}
        self._drags: dict[int, Drag] = {}  # by the client's number
        self._springs: dict[int, tuple[viser.LineSegmentsHandle, viser.LabelHandle]] = {}

    def open_topics(self, below: str, simulator: str) -> None:
        """Open the topics of a character and its simulator, so that they are found in time."""
        self._publisher(below, topics.EXTERNAL_WRENCH)
        self._publisher(simulator, topics.THROW)

    def _publisher(self, below: str, topic: Topic) -> Publisher:
        name = f"{below}/{topic.name}"
        if name not in self._publishers:
            self._publishers[name] = create_publisher(self._node, replace(topic, name=name))
        return self._publishers[name]

    def pour(self, character: LiveCharacter) -> str:
        """Let balls fall on a character; returns a sentence about them."""
        try:
            throws = pour_balls(character.root, self.ball_mass)
        except CommandError as error:
            return f"no balls: {error}"
        for throw in throws:
            self._send(character, throw)
        return f"{len(throws)} more balls; an episode has at most {MOST_BALLS}, then Reset"

    def _send(self, character: LiveCharacter, throw: ProjectileThrow) -> None:
        world, codec = character.rebuilt.world, ThrowCodec(character.rebuilt.known.session)
        self._publisher(world.topics_below, topics.THROW).publish(codec.encode(0, throw))

    def bind(self, below: str, drawn: Callable[[], LiveCharacter | None]) -> Bind:
        """Let the links of a character, as it is drawn then, be dragged and clicked on."""

        def bind(mesh: LinkMesh, row: int) -> None:
            # coroutines, because viser calls functions in several threads, and in any order
            async def drag(event: viser.SceneNodeDragEvent[Any]) -> None:
                self._actions.put(partial(self._drag, below, row, drawn, event))

            async def click(event: viser.SceneNodePointerEvent[Any]) -> None:
                self._actions.put(partial(self._throw, row, drawn, event))

            mesh.on_drag("left")(drag)
            mesh.on_click(modifier="shift")(click)

        return bind

    def _drag(
        self,
        below: str,
        row: int,
        drawn: Callable[[], LiveCharacter | None],
        event: "viser.SceneNodeDragEvent[Any]",
    ) -> None:
        character = drawn()
        if event.phase == "end" or character is None:
            self.release(event.client_id)
            return
        pointer = np.array(event.end_position)
        drag = self._drags.get(event.client_id)
        if drag is None or (drag.below, drag.row) != (below, row):
            self.release(event.client_id)
            start = np.array(event.start_position) + self._scene.offset
            self._drags[event.client_id] = Drag(below, row, character.local(row, start), pointer)
        else:
            drag.pointer = pointer

    def release(self, client: int) -> None:
        """End the drag of a client."""
        self._drags.pop(client, None)
        for handle in self._springs.pop(client, ()):
            handle.remove()

    def pull(self, drawn: Mapping[str, LiveCharacter], stamps_ns: Mapping[str, int]) -> None:
        """Publish and draw the forces of all drags, in the newest states, with these stamps."""
        for client, drag in list(self._drags.items()):
            character = drawn.get(drag.below)
            stamp_ns = stamps_ns.get(drag.below)
            if character is None or stamp_ns is None:
                self.release(client)
                continue
            grabbed = character.point(drag.row, drag.grabbed)
            pointer = drag.pointer + self._scene.offset
            force = spring_force(self.stiffness, grabbed, pointer)
            drag.force = float(np.linalg.norm(force))
            self._push(character, drag, force, stamp_ns)
            self._draw_spring(client, drag, grabbed, pointer)

    def _push(self, character: LiveCharacter, drag: Drag, force: FloatArray, stamp_ns: int) -> None:
        known, simulator = character.rebuilt.known, character.rebuilt.world.topics_below
        began_with = float(known.parameters.get("wrench_duration", _WRENCH_DURATION))
        duration = max(
            self.wrench_durations.get(simulator, began_with), 1.0 / known.parameters["rate"]
        )
        share = drag.share(stamp_ns, duration)
        if share == 0.0:  # nothing has moved: the simulator is paused
            return
        drag.impulse += share * duration * drag.force
        wrench = np.concatenate((share * force, np.zeros(3)))
        push = WrenchArrays.of_rows(
            0, [character.character.links[drag.row].name], [wrench], [drag.grabbed], known.session
        )
        self._publisher(drag.below, topics.EXTERNAL_WRENCH).publish(encode_wrenches(push))

    def _draw_spring(
        self, client: int, drag: Drag, grabbed: FloatArray, pointer: FloatArray
    ) -> None:
        points = np.array([[grabbed, pointer]])
        text = f"{drag.force:.0f} N, {drag.impulse:.1f} N s"
        if client not in self._springs:
            name, api = f"{WORLD}/drags/{client}", self._scene.api
            self._springs[client] = (
                api.add_line_segments(
                    f"{name}/spring", points, _SPRING, thickness=4.0, thickness_units="screen"
                ),
                api.add_label(f"{name}/force", text, position=pointer),
            )
        line, label = self._springs[client]
        line.points, label.text, label.position = points, text, pointer

    def _throw(
        self,
        row: int,
        drawn: Callable[[], LiveCharacter | None],
        event: "viser.SceneNodePointerEvent[Any]",
    ) -> None:
        character = drawn()
        if character is None:
            return
        known = character.rebuilt.known
        try:
            throw = aim_throw(
                np.array(event.ray_origin) + self._scene.offset,
                np.array(event.ray_direction),
                character.centre_of(row),
                mass=self.ball_mass,
                speed=self.ball_speed,
                gravity=float(known.parameters.get("gravity", _GRAVITY)),
            )
        except CommandError as error:
            self._node.get_logger().warning(f"no throw: {error}")
            return
        self._send(character, throw)
