"""What is seen beside a character's links: forces, centre of mass, and what it stands on."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import viser

from actuated_characters.render.engine.camera_pose import Spheres
from actuated_characters.viewer.drawing.colors import CENTRE, CONTACT, PUSH, SUPPORT
from actuated_characters.viewer.drawing.sample import CharacterSample
from actuated_characters.viewer.drawing.support import support_polygon
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.geometry import rotations
from msgs_config.messages.wrenches import WrenchArrays

_METRES_A_WEIGHT = 0.5  # m, length of an arrow that stands for the character's own weight
_MAX_ARROW_LENGTH = 2.0  # m, of an arrow
_MIN_ARROW_SHARE = 1e-3  # share of the weight that an arrow shows at least
_ABOVE_GROUND = 0.004  # m, height of what is drawn on the ground
_GRAVITY = 9.81


class LinkPoses(NamedTuple):
    """Where the links of a character are, world."""

    origins: FloatArray  # (l, 3) m
    turns_xyzw: FloatArray  # (l, 4)

    def point(self, row: int, local: FloatArray) -> FloatArray:
        """A point (3,) of a link, m in its frame, in the world."""
        place: FloatArray = self.origins[row] + rotations.rotate(self.turns_xyzw[row], local)
        return place


class CharacterMarks:
    """The marks of one character, below a frame that goes along with its root.

    A page changes the points of lines and arrows later than the places of frames.
    """

    def __init__(
        self, scene: viser.SceneApi, name: str, character: Character, outlines: Sequence[Spheres]
    ) -> None:
        """Add them below a name; `outlines` are spheres around what of each link collides."""
        self.name = name
        self._character, self._outlines = character, outlines
        self._rows = {link.name: row for row, link in enumerate(character.links)}
        self._centres = np.array([link.inertial_pose.position for link in character.links])
        self._frame = scene.add_frame(name, show_axes=False)
        self._place: FloatArray = np.zeros(3)  # of that frame, m, world
        self._centre = scene.add_icosphere(f"{name}/centre", 0.035, color=CENTRE, visible=False)
        self._below = scene.add_icosphere(f"{name}/below", 0.02, color=CENTRE, visible=False)
        self._arrows = {
            what: scene.add_arrows(
                f"{name}/{what}", np.zeros((1, 2, 3)), color, shaft_radius=0.012,
                head_radius=0.03, head_length=0.06, visible=False,
            )
            for what, color in (("contacts", CONTACT), ("pushes", PUSH))
        }  # fmt: skip
        self._support = scene.add_line_segments(
            f"{name}/support",
            np.zeros((1, 2, 3)),
            SUPPORT,
            thickness=3.0,
            thickness_units="screen",
            visible=False,
        )

    def draw(
        self,
        sample: CharacterSample,
        poses: LinkPoses,
        model: DynamicsModel,
        shows: Mapping[str, bool],
    ) -> None:
        """Bring them to a sample, with the links there and the model in its state."""
        self._place = np.append(poses.origins[0, :2], 0.0)
        self._frame.position = self._place
        self._draw_balance(sample.contacts, poses, model, shown=shows["balance"])
        for what, wrenches in (("contacts", sample.contacts), ("pushes", sample.pushes)):
            self._draw_arrows(what, wrenches if shows["forces"] else None, poses)

    def _draw_balance(
        self,
        contacts: WrenchArrays | None,
        poses: LinkPoses,
        model: DynamicsModel,
        *,
        shown: bool,
    ) -> None:
        """Draw the centre of mass, the point below it, and the support polygon."""
        shown = shown and self._character.layout.has_floating_base
        self._centre.visible = self._below.visible = shown
        corners = np.empty((0, 2))
        if shown:
            centre = model.centre_of_mass() - self._place
            self._centre.position = centre
            self._below.position = (*centre[:2], _ABOVE_GROUND)
            links = contacts.links if contacts is not None else ()
            rows = [self._rows[link] for link in links if link in self._rows]
            corners = support_polygon(
                [self._outlines[row] for row in rows],
                poses.origins[rows],
                poses.turns_xyzw[rows],
            )
        self._support.visible = len(corners) > 1
        if len(corners) > 1:
            corners -= self._place[:2]
            ring = np.column_stack((corners, np.full(len(corners), _ABOVE_GROUND)))
            self._support.points = np.stack((ring, np.roll(ring, -1, axis=0)), axis=1)

    def _draw_arrows(self, what: str, wrenches: WrenchArrays | None, poses: LinkPoses) -> None:
        """Draw forces: those of contacts from where they act, pushes to where they act."""
        arrows = []
        for number, link in enumerate(() if wrenches is None else wrenches.links):
            assert wrenches is not None
            row = self._rows.get(link)
            force = wrenches.wrenches[number, :3] / (self._character.mass * _GRAVITY)
            size = float(np.linalg.norm(force))
            if row is None or size < _MIN_ARROW_SHARE:
                continue
            points = wrenches.points
            at = poses.point(row, points[number] if len(points) else self._centres[row])
            along = force * min(_METRES_A_WEIGHT, _MAX_ARROW_LENGTH / size)
            arrows.append((at, at + along) if what == "contacts" else (at - along, at))
        handle = self._arrows[what]
        handle.visible = bool(arrows)
        if arrows:
            handle.points = np.array(
                [(tail - self._place, tip - self._place) for tail, tip in arrows]
            )
