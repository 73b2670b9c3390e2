"""What a picture marks beside the bodies: the pushes and the contacts of some ticks."""

from collections.abc import Iterator

import numpy as np

from actuated_characters.bags.recording import Wrenches
from actuated_characters.render.engine.renderer import LinkForce
from actuated_characters.render.scene import Scene
from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.messages.wrenches import WrenchArrays

_SHORTEST = 0.25  # of the longest arrow: the shortest one


class Marks:
    """Finds what acted on the links of a scene's characters."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._rows: list[dict[str, int]] = []  # of each character's links, among all
        self._centres: list[tuple[float, float, float]] = []
        for character in scene.characters:
            first = len(self._centres)
            names = [link.name for link in character.links]
            self._rows.append({name: first + row for row, name in enumerate(names)})
            self._centres += [link.inertial_pose.position for link in character.links]
        acted = [r.applied_wrench for r in scene.recordings]
        norms = [_norm(wrench) for each in acted for wrench in each if wrench is not None]
        self._strongest = max((float(norm.max(initial=0.0)) for norm in norms), default=0.0)

    def forces(self, begin: int, end: int, longest: float) -> tuple[LinkForce, ...]:
        """The strongest push of each link in ticks from one to before another, as arrows.

        The recording's strongest push has the longest arrow, m, and none has less than a part.
        """
        strongest: dict[int, tuple[float, LinkForce]] = {}
        for rows, said in self._said(begin, end, "applied_wrench"):
            points = said.points
            for number, norm in enumerate(_norm(said).tolist()):
                row = rows.get(said.links[number])
                if row is None or norm == 0.0 or norm <= strongest.get(row, (0.0,))[0]:
                    continue
                share = _SHORTEST + (1.0 - _SHORTEST) * norm / self._strongest
                arrow = said.wrenches[number, :3] * (share * longest / norm)
                point = points[number] if len(points) else np.array(self._centres[row])
                strongest[row] = norm, LinkForce(row, point, arrow)
        return tuple(force for _, force in strongest.values())

    def touching(self, begin: int, end: int) -> BoolArray:
        """Which of all links (l,) touched something in ticks from one to before another."""
        touched = np.zeros(len(self._centres), dtype=np.bool_)
        for rows, said in self._said(begin, end, "contacts"):
            touched[[rows[name] for name in said.links if name in rows]] = True
        return touched

    def _said(
        self, begin: int, end: int, what: str
    ) -> Iterator[tuple[dict[str, int], WrenchArrays]]:
        for rows, recording in zip(self._rows, self._scene.recordings, strict=True):
            wrenches: Wrenches = getattr(recording, what)
            for said in wrenches[begin:end]:
                if said is not None:
                    yield rows, said


def _norm(said: WrenchArrays) -> FloatArray:
    """Norms (m,) of the forces, N."""
    norms: FloatArray = np.linalg.norm(said.wrenches[:, :3], axis=1)
    return norms
