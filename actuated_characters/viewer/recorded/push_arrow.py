"""A push that is drawn as an arrow on the body of a recorded run: what a fork can begin with.

A drag holds the run, and leads from the centre of mass of the link, where the push will act, to the
pointer: in the plane through the grabbed point that faces the camera.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import viser

from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.controls.touch import STIFFNESS, spring_force
from actuated_characters.viewer.drawing.drawn_character import Bind, DrawnCharacter, LinkMesh
from actuated_characters.viewer.drawing.scene import WORLD, BrowserScene
from actuated_characters.viewer.recorded.timeline import Playback
from msgs_config.arrays import FloatArray

_COLOUR = (230, 60, 20)
_LEAST_FORCE = 5.0  # N: less is no push but a click


@dataclass(frozen=True)
class DrawnPush:
    """A force on a link's centre of mass, in whole N."""

    link: str
    force: tuple[int, int, int]  # N, world axes

    @property
    def text(self) -> str:
        """As `fork` takes it, without its time."""
        return f"{self.link}:{','.join(map(str, self.force))}"

    @property
    def size(self) -> float:
        """The force's size, N."""
        return float(np.linalg.norm(self.force))


class PushArrow:
    """The arrow on the one character of a run; its methods are for the player's thread."""

    def __init__(
        self,
        scene: BrowserScene,
        timeline: Playback,
        actions: ActionQueue,
        duration: float,
        changed: Callable[[DrawnPush | None, bool], None],
    ) -> None:
        """`duration` is how long a push acts, s.

        `changed` is told the present push, None if there is none any more, and whether it was let
        go.
        """
        self._scene, self._timeline, self._actions = scene, timeline, actions
        self._duration, self._changed = duration, changed
        self._drawn: DrawnCharacter | None = None
        self._push: DrawnPush | None = None
        self._row = 0  # of the state in which it was drawn
        self._client: int | None = None  # who has begun the last drag, until it is let go
        self._nodes: tuple[viser.ArrowsHandle, viser.LabelHandle] | None = None

    def draw_on(self, drawn: DrawnCharacter) -> None:
        """Be on a character that was made with `bind`."""
        self._drawn = drawn

    @property
    def bind(self) -> Bind:
        """Lets the links of a character be dragged."""

        def bind(mesh: LinkMesh, row: int) -> None:
            # a coroutine, because viser calls functions in several threads, and in any order
            async def drag(event: viser.SceneNodeDragEvent[Any]) -> None:
                self._actions.put(partial(self._drag, row, event))

            mesh.on_drag("left")(drag)

        return bind

    def _drag(self, row: int, event: "viser.SceneNodeDragEvent[Any]") -> None:
        if self._drawn is None:
            return
        timeline, is_end = self._timeline, event.phase == "end"
        if event.phase == "start":
            timeline.plays = False
            self._row = timeline.row
        elif self._client != event.client_id or self._row != timeline.row:
            return  # another page has begun one since, or has gone to another time
        self._client = None if is_end else event.client_id
        centre = self._drawn.centre_of(row)
        pointer = np.array(event.end_position) + self._scene.offset
        force = spring_force(STIFFNESS, centre, pointer)
        x, y, z = np.round(force).astype(int).tolist()
        push = DrawnPush(self._drawn.character.links[row].name, (x, y, z))
        if push.size < _LEAST_FORCE:
            if is_end:
                self.discard()
            return
        self._push = push
        self._show(centre, centre + np.array(push.force) / STIFFNESS)
        self._changed(push, is_end)

    def _show(self, tail: FloatArray, tip: FloatArray) -> None:
        """Draw it from its tail to its tip, m, world."""
        assert self._push is not None
        points = np.array([[tail, tip]])
        text = f"{self._push.link}: {self._push.size:.0f} N for {self._duration:.3g} s"
        if self._nodes is None:
            name, api = f"{WORLD}/push", self._scene.api
            self._nodes = (
                api.add_arrows(
                    f"{name}/arrow", points, _COLOUR, shaft_radius=0.012, head_radius=0.03,
                    head_length=0.06,
                ),
                api.add_label(f"{name}/label", text, position=tip),
            )  # fmt: skip
        arrow, label = self._nodes
        arrow.points, label.text, label.position = points, text, tip

    def update(self) -> None:
        """Drop it where the run is in another state by now."""
        if self._push is not None and (self._timeline.plays or self._row != self._timeline.row):
            self.discard()

    def discard(self) -> None:
        """Remove it."""
        self._client = None
        if self._push is not None:
            self._push = None
            self._changed(None, False)
        for node in self._nodes or ():
            node.remove()
        self._nodes = None
