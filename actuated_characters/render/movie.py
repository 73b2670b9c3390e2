"""A recorded run as a movie: what each of its pictures shows, and from where it is seen."""

import os
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise
from math import ceil, cos, floor, sin
from pathlib import Path

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.camera_path import smoothed
from actuated_characters.render.captions import write_on
from actuated_characters.render.drawing import SceneSettings, draw
from actuated_characters.render.engine.camera_pose import (
    CameraPose,
    Size,
    Spheres,
    extents,
    framing,
)
from actuated_characters.render.engine.posed_characters import PosedCharacters, root_path
from actuated_characters.render.engine.renderer import FrameSpec, Picture
from actuated_characters.render.films import check_film, write_film
from actuated_characters.render.scene import RecordedScene, make_scene, part_of
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.stills import LONGEST_ARROW, Progress, check_size
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.clips.nearest_rows import nearest_rows
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.geometry import rotations

MOVIE_SIZE = (960, 540)

_YAW, _PITCH = 0.75, 0.22  # rad: from the right side and in front, so that beside is not behind
_FOLLOWED_S = 0.6  # s of the root's path before and after that count for the camera's
_LEAST_BESIDE = 0.5  # share of its height: the ghost of a narrower character is so far beside it
_MOST_FRAMED = 150  # pictures that decide on the scale
# A ghost that is farther away, in heights of the character, may leave the picture.
_GHOST_RANGE = 1.5
_CAPTION_SEPARATOR = "   "  # what separates the parts of a caption
_MOST_PICTURES = 100_000
_PICTURES_A_WORKER = 15  # fewer are drawn sooner than another process has started


class GhostPlace(Enum):
    """Where a movie has the reference."""

    BESIDE = "beside"  # beside the character, so that both are seen whole
    OVER = "over"  # where the reference really is, over the character
    NONE = "none"


@dataclass(frozen=True)
class MovieSettings:
    """How a movie is made."""

    fps: int = 30  # pictures for each second of the movie
    speed: float = 1.0  # simulated seconds for each second of the movie
    start: float = 0.0  # s since the first state
    end: float | None = None  # s; None: to the last state
    size: Size = MOVIE_SIZE
    ghost: GhostPlace | None = None  # None: beside if there is a reference
    contacts: bool = False  # mark the links that touch something
    skinned: bool = True  # draw a smooth skin in place of plain shapes
    skin: GivenSkin | None = None  # a mesh from a file as that skin
    workers: int | None = None  # processes that draw; None: as many as there are cores


class Movie:
    """A movie of the characters of one world; its p pictures are the same for any workers."""

    def __init__(
        self, recordings: Sequence[Recording], settings: MovieSettings | None = None
    ) -> None:
        """Find what there is to be seen in each picture.

        Raises:
            ConfigurationError: a setting is not possible, or the recording does not reach so far.
            RecordingError: the recordings are of several worlds, or a ghost is asked for and there
                is no reference; or no contacts where these are.
            CharacterError: a file of a character cannot be used.
        """
        self._settings = settings or MovieSettings()
        check_size(self._settings.size, 1)
        if self._settings.workers is not None and self._settings.workers < 1:
            raise ConfigurationError(f"{self._settings.workers} processes; it must be 1 or more")
        self._scene = make_scene(recordings)
        if self._settings.contacts and not any(r.contacts for r in self._scene.recordings):
            raise RecordingError(
                "the recording has no contacts to mark: it was recorded with --exclude contacts, "
                "or by another recorder"
            )
        self._ghost = _ghost_place(self._scene, self._settings.ghost)
        self._rows = picture_rows(self._scene.times, self._settings)
        captions = [caption(self._scene, row, self._settings.speed) for row in self._rows.tolist()]
        has_ghosts = self._ghost is not GhostPlace.NONE
        frames = self._scene.frames(
            self._rows, captions, ghosts=has_ghosts, contacts=self._settings.contacts
        )
        self._frames = self._with_views(frames)

    def __len__(self) -> int:
        return len(self._rows)

    def pictures(self) -> Generator[Picture, None, None]:
        """The pictures (h, w, 3), as they are asked for; close it when that is not to the end.

        Raises:
            CharacterError: a file of a character or of the terrain cannot be used.
            RunError: a process that draws ended.
        """
        scene, most = self._scene, self._settings.workers
        if most is None:
            most = min(len(os.sched_getaffinity(0)), ceil(len(self) / _PICTURES_A_WORKER))
        stays = SceneSettings(
            scene.characters,
            scene.ground,
            scene.terrain,
            self._settings.size,
            write_on,
            self._settings.skinned,
            self._settings.skin,
            scene.color_numbers,
        )
        return draw(stays, self._frames, most)

    def save(self, path: Path, progress: Progress | None = None) -> None:
        """Write a film, whole or not at all; `progress` is told the pictures so far.

        Raises:
            ConfigurationError, RecordingError: see `write_film`.
        """
        settings = self._settings
        check_film(path, len(self), settings.size, settings.fps)
        with closing(self.pictures()) as pictures:
            counted = pictures if progress is None else _counted(pictures, progress)
            write_film(path, counted, len(self), settings.size, settings.fps)

    def _with_views(self, frames: Sequence[FrameSpec]) -> list[FrameSpec]:
        """The frames with their views, the places of their ghosts and the length of arrows."""
        scene, heading = self._scene, _heading(self._scene)
        settings = self._settings
        posed = PosedCharacters(scene.characters, settings.skin if settings.skinned else None)
        path, some = (
            camera_path(scene)[self._rows],
            slice(None, None, ceil(len(self) / _MOST_FRAMED)),
        )
        ways = path - path[0]
        like, offset = CameraPose(yaw=heading + _YAW, pitch=_PITCH), (0.0, 0.0, 0.0)
        bodies = posed.outline(scene.position[self._rows[some]], ways[some])
        width, height, _ = extents(bodies, like).tolist()
        if self._ghost is GhostPlace.BESIDE:  # the left side is away from the camera
            distance = max(width, _LEAST_BESIDE * height) / sin(_YAW)
            offset = (-distance * sin(heading), distance * cos(heading), 0.0)
        ghosts = self._near_references(self._rows[some], _GHOST_RANGE * height)
        longest = LONGEST_ARROW * max(width, height)
        seen = [
            bodies,
            posed.outline(ghosts, ways[some]).moved(offset),
            posed.tails(scene.position[self._rows], ways, [f.forces for f in frames], longest),
        ]
        wide, high = settings.size
        view = framing(Spheres.joined(seen), wide / high, like)
        return [
            replace(frame, view=view.moved(*way), ghost_offset=offset, arrow_length=longest)
            for frame, way in zip(frames, ways.tolist(), strict=True)
        ]

    def _near_references(self, rows: IntArray, farthest: float) -> FloatArray:
        """The references (p, n) in states (p,), NaN unless all are drawn near their characters."""
        near = np.full(len(rows), self._ghost is not GhostPlace.NONE)
        for recording in self._scene.recordings:
            if recording.layout.has_floating_base:
                away = recording.reference_position[rows, :2] - recording.position[rows, :2]
                near &= ~(np.linalg.norm(away, axis=1) > farthest)
        return np.where(near[:, np.newaxis], self._scene.reference[rows], np.nan)


def picture_rows(times: FloatArray, settings: MovieSettings) -> IntArray:
    """The states (p,) nearest to the pictures' times, of two that are as near the earlier one.

    Args:
        times: Of the states (t + 1,), s since the first one.
        settings: Of them rate, speed, start and end count.

    Raises:
        ConfigurationError: they are not possible, or the states do not reach so far.
    """
    start, end = part_of(times, settings.start, settings.end)
    if not (0.0 < settings.speed < np.inf and settings.fps >= 1):
        raise ConfigurationError(
            f"{settings.fps} pictures a second at speed {settings.speed:g}; both must be positive"
        )
    step = settings.speed / settings.fps
    count = (end - start) / step + 1e-6  # the last state is not lost to rounding
    if count >= _MOST_PICTURES:
        raise ConfigurationError(
            f"the movie would have {count:.0f} pictures; it must be {_MOST_PICTURES} or fewer"
        )
    return nearest_rows(times, start + step * np.arange(floor(count) + 1.0))


def camera_path(scene: RecordedScene) -> FloatArray:
    """Where (t + 1, 2) the camera is with the characters, m along the ground; it cuts at resets.

    It follows the middle of their roots; where one has a fixed base it rests.
    """
    path = root_path(scene.characters, scene.position)
    step = float(scene.times[1]) if len(scene.times) > 1 else 1.0
    reach, ends = round(_FOLLOWED_S / step), [*scene.episode_rows.tolist(), len(path)]
    return np.concatenate([smoothed(path[a:b], reach) for a, b in pairwise(ends)])


def caption(scene: RecordedScene, row: int, speed: float = 1.0) -> str:
    """What is written on the picture of a state: when it is, and how it came about."""
    parts = [f"{scene.times[row]:.2f} s"]
    if speed != 1.0:
        parts.append(f"speed {speed:g}")
    stamp = int(scene.recordings[0].stamps_ns[row])
    laws = dict.fromkeys(law for r in scene.recordings if (law := _law(r, stamp)))
    parts += [", ".join(laws)] if laws else []
    if scene.recordings[0].parameters.get("mode") == "realtime":
        parts.append("real time")
    if len(scene.episode_rows) > 1:
        parts.append(f"episode {np.searchsorted(scene.episode_rows, row, side='right')}")
    return _CAPTION_SEPARATOR.join(parts)


def _law(recording: Recording, stamp_ns: int) -> str:
    """The name of the law in force at a state, empty if no controller has published it."""
    law = ""
    for settings in recording.controller:
        if settings.after_stamp_ns is None or stamp_ns > settings.after_stamp_ns:
            law = str(settings.parameters.get("law", ""))
    return law


def _ghost_place(scene: RecordedScene, wanted: GhostPlace | None) -> GhostPlace:
    if scene.has_reference:
        return wanted or GhostPlace.BESIDE
    if wanted in (GhostPlace.BESIDE, GhostPlace.OVER):
        raise RecordingError("the recording has no reference to draw")
    return GhostPlace.NONE


def _heading(scene: RecordedScene) -> float:
    """Where the first character faces at first: a turn about z from how its file has it, rad."""
    recording = scene.recordings[0]
    character = recording.character
    yaw = character.placement.yaw
    if not character.layout.has_floating_base:
        return yaw
    now = rotations.exp(recording.position[0, 3:6])
    rest = rotations.exp(np.array(character.rest_position[3:6]))
    return yaw + float(rotations.yaw(rotations.multiply(now, rotations.conjugate(rest))))


def _counted(pictures: Iterator[Picture], progress: Progress) -> Iterator[Picture]:
    for number, picture in enumerate(pictures):
        yield picture
        progress(number + 1)
