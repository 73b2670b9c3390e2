"""A recorded run as a film: what each of its pictures shows, and from where it is seen."""

import os
from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from enum import Enum
from math import ceil, cos, floor, sin
from pathlib import Path
from typing import TypeAlias

import numpy as np

from actuated_characters.bags.recording import Recording
from actuated_characters.render.annotations import Marks
from actuated_characters.render.camera_path import followed_path
from actuated_characters.render.drawing import FrameSpec, SceneSettings, draw
from actuated_characters.render.engine.camera_pose import CameraPose
from actuated_characters.render.engine.render_scene import Size
from actuated_characters.render.engine.renderer import LinkForce, Picture, Renderer
from actuated_characters.render.scene import Scene, make_scene, nearest_rows
from actuated_characters.render.stills import Progress, check_size
from actuated_characters.render.video import check_video, write_video
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.model import Vector
from msgs_config.errors import ConfigurationError, RecordingError
from msgs_config.geometry import rotations

MOVIE_SIZE = (960, 540)

_YAW, _PITCH = 0.75, 0.22  # rad: from the right side and in front, so that beside is not behind
_FOLLOWED_S = 0.6  # how much of the root's path before and after counts for the camera's
_LEAST_BESIDE = 0.5  # of its height: where a character is narrower, its ghost is so far away
_ARROWS = 0.4  # of the character's extent: the longest arrow
_MOST_FRAMED = 150  # pictures that decide on the scale
_ASTRAY = 1.5  # of the character's size: a ghost that is farther away may leave the picture
_HERE = (0.0, 0.0, 0.0)
_BETWEEN = "   "  # the parts of a caption
_MOST_PICTURES = 100_000
_PICTURES_A_WORKER = 15  # fewer are drawn sooner than another process has started


Forces: TypeAlias = list[tuple[LinkForce, ...]]
"""The arrows of each picture."""


class GhostPlace(Enum):
    """Where a film has the reference."""

    BESIDE = "beside"  # so that both are seen whole
    OVER = "over"  # where it really is
    NONE = "none"


@dataclass(frozen=True)
class MovieSettings:
    """How a film is made."""

    fps: int = 30  # pictures for each second of the film
    speed: float = 1.0  # simulated seconds for each of the film
    start: float = 0.0  # s since the first state
    end: float | None = None  # s; None: to the last state
    size: Size = MOVIE_SIZE
    ghost: GhostPlace | None = None  # None: beside if there is a reference
    contacts: bool = False  # mark the links that touch something
    workers: int | None = None  # processes that draw; None: as many as there are cores


class Movie:
    """A film of the characters of one world; its p pictures are the same for any workers."""

    def __init__(
        self, recordings: Sequence[Recording], settings: MovieSettings | None = None
    ) -> None:
        """Say what there is to be seen in each picture.

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
        self._ghost = _ghost_place(self._scene, self._settings.ghost)
        if self._settings.contacts and not any(r.contacts for r in self._scene.recordings):
            raise RecordingError(
                "the recording has no contacts to mark: it was recorded with --exclude contacts, "
                "or by another recorder"
            )
        self.rows = picture_rows(self._scene.times, self._settings)
        self._paths = camera_paths(self._scene)[self.rows]
        self._view, offset, self._arrows = self._framing()
        scene = self._scene
        self._set = SceneSettings(
            scene.characters, scene.ground, scene.terrain, offset, self._settings.size
        )

    def __len__(self) -> int:
        return len(self.rows)

    def pictures(self) -> Generator[Picture, None, None]:
        """The pictures (h, w, 3), as they are asked for; close it when that is not to the end.

        Raises:
            CharacterError: a file of a character or of the terrain cannot be used.
            RunError: a process that draws ended.
        """
        most = self._settings.workers
        if most is None:
            most = min(len(os.sched_getaffinity(0)), ceil(len(self) / _PICTURES_A_WORKER))
        return draw(self._set, self._shots(), most)

    def save(self, path: Path, progress: Progress | None = None) -> None:
        """Write an MP4 file, whole or not at all; `progress` is told the pictures so far.

        Raises:
            ConfigurationError, RecordingError: see `write_video`.
        """
        settings = self._settings
        check_video(settings.size, settings.fps)
        with closing(self.pictures()) as pictures:
            counted = pictures if progress is None else _counted(pictures, progress)
            write_video(path, counted, settings.size, settings.fps)

    def _framing(self) -> tuple[CameraPose, Vector, Forces]:
        """The view of the first picture, how far the ghost is drawn from its place, the arrows."""
        scene, size = self._scene, self._settings.size
        ways = self._paths - self._paths[0]
        some = slice(None, None, ceil(len(self) / _MOST_FRAMED))
        positions, ghosts = scene.position[self.rows[some]], scene.reference[self.rows[some]]
        heading, offset = _heading(scene), _HERE
        like = CameraPose(yaw=heading + _YAW, pitch=_PITCH)
        with Renderer(scene.characters, ground=False) as camera:
            width, height, _ = camera.extents(positions, ways[some], like).tolist()
            if self._ghost is GhostPlace.BESIDE:
                offset = _beside(heading, max(width, _LEAST_BESIDE * height) / sin(_YAW))
            is_far = _astray(scene, self.rows[some]) > _ASTRAY * height
            ghosts = np.where(is_far | (self._ghost is GhostPlace.NONE), np.nan, ghosts)
            forces = self._forces(_ARROWS * max(width, height))
            tails = [
                camera.tail(scene.position[row], force) - (*way.tolist(), 0.0)
                for row, way, own in zip(self.rows, ways, forces, strict=True)
                for force in own
            ]
            view = camera.view_along(
                positions,
                ways[some],
                ghosts=ghosts,
                ghost_offset=offset,
                besides=tails,
                like=like,
                size=size,
            )
        return view, offset, forces

    def _forces(self, longest: float) -> Forces:
        """The pushes between each picture and the one before it; the strongest so many m long."""
        marks = Marks(self._scene)
        return [marks.forces(*ticks, longest) for ticks in self._ticks()]

    def _ticks(self) -> Iterator[tuple[int, int]]:
        """First tick, and the one after the last, that led from one picture to the next."""
        before = max(int(self.rows[0]) - 1, 0)
        for row in self.rows.tolist():
            yield min(before, max(row - 1, 0)), row
            before = row

    def _shots(self) -> list[FrameSpec]:
        scene, marks = self._scene, Marks(self._scene)
        ways = (self._paths - self._paths[0]).tolist()
        each = zip(self.rows.tolist(), ways, self._arrows, self._ticks(), strict=True)
        return [
            FrameSpec(
                position=scene.position[row],
                ghost=None if self._ghost is GhostPlace.NONE else scene.reference[row],
                forces=forces,
                touching=marks.touching(*ticks) if self._settings.contacts else None,
                balls=scene.balls(row),
                view=self._view.moved(*way),
                caption=caption(scene, row, self._settings.speed),
            )
            for row, way, forces, ticks in each
        ]


def picture_rows(times: FloatArray, settings: MovieSettings) -> IntArray:
    """The states (p,) nearest to the pictures' times, of two that are as near the earlier one.

    Args:
        times: Of the states (t + 1,), s since the first one.
        settings: Of them rate, speed, start and end count.

    Raises:
        ConfigurationError: they are not possible, or the states do not reach so far.
    """
    last = float(times[-1])
    end = last if settings.end is None else settings.end
    if not 0.0 <= settings.start <= end <= last:
        raise ConfigurationError(
            f"from {settings.start:g} s to {end:g} s is not in the recording: 0 to {last:g} s"
        )
    if not (0.0 < settings.speed < np.inf and settings.fps >= 1):
        raise ConfigurationError(
            f"{settings.fps} pictures a second at speed {settings.speed:g}; both must be positive"
        )
    step = settings.speed / settings.fps
    count = (end - settings.start) / step + 1e-6  # the last state is not lost to rounding
    if count >= _MOST_PICTURES:
        raise ConfigurationError(
            f"the film would have {count:.0f} pictures; it must be {_MOST_PICTURES} or fewer"
        )
    wanted = settings.start + step * np.arange(floor(count) + 1.0)
    return nearest_rows(times, wanted)


def camera_paths(scene: Scene) -> FloatArray:
    """Where (t + 1, 2) the camera is with the characters, m along the ground; it cuts at resets.

    It follows the middle of their roots; where one has a fixed base it rests.
    """
    path = np.zeros((len(scene.times), 2))
    if not all(character.layout.has_floating_base for character in scene.characters):
        return path
    path = np.mean([recording.position[:, :2] for recording in scene.recordings], axis=0)
    step = float(scene.times[1]) if len(scene.times) > 1 else 1.0
    return followed_path(path, scene.episode_rows.tolist(), round(_FOLLOWED_S / step))


def caption(scene: Scene, row: int, speed: float = 1.0) -> str:
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
    return _BETWEEN.join(parts)


def _law(recording: Recording, stamp_ns: int) -> str:
    """The name of the law in force at a state, empty if no controller has said it."""
    law = ""
    for settings in recording.controller:
        if settings.after_stamp_ns is None or stamp_ns > settings.after_stamp_ns:
            law = str(settings.parameters.get("law", ""))
    return law


def _ghost_place(scene: Scene, wanted: GhostPlace | None) -> GhostPlace:
    if scene.has_reference:
        return wanted or GhostPlace.BESIDE
    if wanted in (GhostPlace.BESIDE, GhostPlace.OVER):
        raise RecordingError("the recording has no reference to draw")
    return GhostPlace.NONE


def _heading(scene: Scene) -> float:
    """Where the first character faces at first: a turn about z from how its file has it, rad."""
    recording = scene.recordings[0]
    character = recording.character
    yaw = character.placement.yaw
    if not character.layout.has_floating_base:
        return yaw
    now = rotations.exp(recording.position[0, 3:6])
    rest = rotations.exp(np.array(character.rest_position[3:6]))
    return yaw + float(rotations.yaw(rotations.multiply(now, rotations.conjugate(rest))))


def _beside(heading: float, distance: float) -> Vector:
    """So far to the left of who faces there, which is away from the camera, m."""
    return -distance * sin(heading), distance * cos(heading), 0.0


def _astray(scene: Scene, rows: IntArray) -> FloatArray:
    """How far (p, 1) the reference's roots are at the most from the characters' in states (p,)."""
    farthest = np.zeros((len(rows), 1))
    for recording in scene.recordings:
        if recording.layout.has_floating_base:
            away = recording.reference_position[rows, :2] - recording.position[rows, :2]
            norm = np.nan_to_num(np.linalg.norm(away, axis=1, keepdims=True))
            farthest = np.maximum(farthest, norm)
    return farthest


def _counted(pictures: Iterator[Picture], progress: Progress) -> Iterator[Picture]:
    for number, picture in enumerate(pictures):
        yield picture
        progress(number + 1)
