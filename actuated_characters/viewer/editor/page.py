"""The page of a timeline that is made: the character with its handles, and the loop that draws."""

import time
from functools import partial
from typing import Any

import numpy as np
import viser

from actuated_characters.render.engine.outlines import outline
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.viewer.controls.actions import ActionQueue
from actuated_characters.viewer.drawing.drawn_character import DrawnCharacter, LinkMesh
from actuated_characters.viewer.drawing.sample import CharacterSample
from actuated_characters.viewer.drawing.scene import WORLD, BrowserScene, DrawnBalls
from actuated_characters.viewer.drawing.scene_poses import set_poses
from actuated_characters.viewer.editor.handles import Drag, Handle, handles_of, standing_links
from actuated_characters.viewer.editor.key_marks import find_key_marks
from actuated_characters.viewer.editor.panel import EditorPanel
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.editor.shown_takes import ShownTakes
from actuated_characters.viewer.editor.time_edits import TimeEdits
from actuated_characters.viewer.recorded.time_bar import TimeBar
from actuated_characters.viewer.recorded.timeline import row_at
from actuated_characters.viewer.web.rejections import Rejections
from actuated_characters.viewer.web.server import ViewerServer
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape
from msgs_config.messages.state import StampedState

_LEAST_REST = 0.003  # s of rest after a picture, for the threads that send it
_HANDLE, _HANDLE_OPACITY = (240, 140, 20), 0.4
_LEAST_RADIUS, _AROUND = 0.065, 0.015  # m: of a handle, and beyond what is round of its link


class EditorPage:
    """Draws the pose that a session is in, and lets it be dragged."""

    def __init__(
        self, server: ViewerServer, session: Session, skin: GivenSkin | None = None
    ) -> None:
        """Build the scene, with a mesh from a file as the character's skin, if given.

        Raises:
            ActuatedCharactersError: a mesh or `skin` cannot be used.
        """
        self._server, self._session = server, session
        self._actions = ActionQueue()
        self._scene = BrowserScene(server)
        character = session.character
        self._drawn = DrawnCharacter(
            self._scene.api,
            f"{WORLD}/characters/0",
            character,
            character.effort_limits(),
            self._bind,
            0,
            skin,
        )
        self._balls, self._shapes = DrawnBalls(self._scene.api, f"{WORLD}/balls"), list[Shape]()
        self.takes = ShownTakes(session.document.file)
        session.seen = self.takes.position
        self._handles = handles_of(character)
        self._spheres = [self._add_handle(handle) for handle in self._handles]
        self._panel = EditorPanel(server.gui, session, self.takes, self._actions)
        self._bar = TimeBar(server, session.playback, self._panel.time)
        self._edits = TimeEdits(
            server.gui, self._bar, session, self._panel.chosen, self._panel.act, self._actions
        )
        self._marked: tuple[object, ...] | None = None  # what the marks are of that are shown
        self._edited = (session.version, session.poses_by_hand)
        self._drag: Drag | None = None
        self._pointer: FloatArray = np.zeros(3)  # where it began, m, the browser's
        self._client: int | None = None  # whose drag it is
        self.draw()
        self._scene.frame_characters([self._drawn])

    def _add_handle(self, handle: Handle) -> viser.IcosphereHandle:
        shapes = self._session.character.links[handle.row].collision_shapes
        round_ones = [float(outline(shape).radii.max(initial=0.0)) for shape in shapes]
        sphere = self._scene.api.add_icosphere(
            f"{WORLD}/handles/{handle.row}",
            max(_LEAST_RADIUS, max(round_ones, default=0.0) + _AROUND),
            _HANDLE,
            opacity=_HANDLE_OPACITY,
            cast_shadow=False,
            receive_shadow=False,
        )

        async def drag(event: viser.SceneNodeDragEvent[Any]) -> None:
            self._actions.put(partial(self._dragged, handle, event))

        sphere.on_drag("left")(drag)
        return sphere

    def _bind(self, mesh: LinkMesh, row: int) -> None:
        """Let a link be dragged at any of its points."""

        async def drag(event: viser.SceneNodeDragEvent[Any]) -> None:
            self._actions.put(partial(self._dragged_link, row, event))

        mesh.on_drag("left")(drag)

    def _dragged_link(self, row: int, event: "viser.SceneNodeDragEvent[Any]") -> None:
        point = self._drawn.local(row, np.array(event.start_position) + self._scene.offset)
        x, y, z = point.tolist()
        self._dragged(Handle(row, (x, y, z)), event)

    def _dragged(self, handle: Handle, event: "viser.SceneNodeDragEvent[Any]") -> None:
        session = self._session
        if event.phase == "start":
            pose = session.pose
            self.takes.leave()
            session.take_pose(pose)
            stands = standing_links(session.character, pose) if self._panel.feet_stay else ()
            self._drag = Drag(
                session.posing,
                session.character,
                pose,
                handle,
                limb_alone=self._panel.limb_alone,
                stands=stands,
            )
            self._client, self._pointer = event.client_id, np.array(event.start_position)
        if self._drag is None or self._client != event.client_id:
            return  # of another page, which has come later
        way = np.array(event.end_position) - self._pointer
        session.take_pose(self._drag.pose(self._drag.place + way))
        if event.phase == "end":
            self._drag = self._client = None

    def play(self, fps: float, rejections: Rejections) -> None:
        """Show it until an interruption, and print what is rejected."""
        before = time.monotonic()
        while True:
            now = time.monotonic()
            self.step(now - before)
            for sentence in rejections.take():
                print(sentence, flush=True)
            before = now
            time.sleep(max(1.0 / fps - (time.monotonic() - now), _LEAST_REST))

    def step(self, seconds: float) -> None:
        """Do what clients have done, go on by a wall time in s if it plays, and draw."""
        self._actions.run()
        self._see_edits()
        self._session.playback.advance(seconds)
        self.draw()
        if self._drag is None:  # the world must not move while something is dragged
            self._scene.follow_characters([self._drawn], seconds)

    def _see_edits(self) -> None:
        """Have what was edited seen, and no take."""
        edited = (self._session.version, self._session.poses_by_hand)
        if self._edited != edited:
            self._edited = edited
            self.takes.leave()

    def draw(self) -> None:
        """Bring all pages to the session."""
        session = self._session
        sample = self.takes.sample(session.time)
        if sample is None:
            still = np.zeros(session.character.layout.size)
            sample = CharacterSample(StampedState(0, session.pose.position, still, None))
        with self._server.atomic():
            self._drawn.draw(sample)
            self._draw_balls()
            places = [self._drawn.point(each.row, np.array(each.point)) for each in self._handles]
            turns = self._drawn.turns_xyzw[[each.row for each in self._handles]]
            set_poses(self._spheres, np.array(places).reshape(-1, 3), turns)
            for sphere in self._spheres:  # a take is seen without; its links can be dragged
                sphere.visible = self.takes.run is None
            self._bar.show_time()
        self._panel.show()
        self._mark()

    def _mark(self) -> None:
        """Bring the marks of the time line to the session, also where an edit was refused."""
        session = self._session
        event, end = self._panel.chosen.event, session.playback.end
        marked = (session.version, session.layer, event, end, self._edits.count)
        if self._marked != marked:
            self._marked = marked
            self._bar.tell(
                document=session.version, layer=session.layer, chosen=str(event) if event else ""
            )
            self._bar.mark(find_key_marks(session.document.content, end))

    def _draw_balls(self) -> None:
        """Draw the balls of the take that is seen."""
        run, shapes = self.takes.run, list[Shape]()
        balls = None
        if run is not None:
            balls, shapes = run.balls(row_at(run.times, self._session.time))
        if shapes != self._shapes:
            self._balls.remove()
            self._shapes = shapes
        if balls is not None:
            self._balls.place(balls, dict(zip(balls.names, shapes, strict=True)).__getitem__)
