"""Where motion comes from: a run's directory, a bag, or a clip."""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import ceil
from pathlib import Path

import numpy as np

from actuated_characters.bags.format.storage import FILE_SUFFIXES, SUFFIXES
from actuated_characters.bags.recording import Recording
from actuated_characters.bags.robots.reading import RobotSource, read_any
from actuated_characters.render.scene import RecordedScene, make_scene
from character_motion.export.trajectories import (
    BallTrajectory,
    CharacterTrajectory,
    Trajectories,
)
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.loading import load_character
from msgs_config.character.model import Character
from msgs_config.clips.reading import read_clip
from msgs_config.errors import ClipError, ConfigurationError, RecordingError
from msgs_config.file_kinds import refuse_other_kind

_CHARACTER = "humanoid"
_CLIP_SUFFIXES = (".txt", ".json")
_HIGHEST_RATE = 60.0  # Hz, at which a recording is sampled unless told
_DURATION_TOLERANCE = 0.05  # part of a frame's duration by which another may differ
_AWAY_DISTANCE = 1000.0  # m: a ball farther away has been taken out of the way


def read_source(
    source: str,
    robot: RobotSource | None = None,
    told: Callable[[Sequence[Recording]], None] = lambda recordings: None,
) -> Trajectories:
    """What moves in a run, a bag or a clip.

    Args:
        source: A run's directory, a bag, or a clip by its name or as a .txt or .json file.
        robot: Whose it is. Its `character` is, of a run, the name of the one that is wanted, None
            for all in its world; of a bag of another robot, and of a clip, the character whose it
            is, of a clip by default the humanoid.
        told: Called with the recordings that were read.

    Raises:
        ActuatedCharactersError: there is no such source, or it cannot be read.
    """
    robot = robot or RobotSource()
    recordings = read_recorded(source, robot, told)
    if recordings:
        return of_recordings(recordings)
    if robot.topic is not None or robot.base is not None:
        raise ConfigurationError(f"--topic and --base are of a bag; {source} is none")
    try:
        return of_clip(load_character(robot.character or _CHARACTER), source)
    except ClipError as error:
        if Path(source).suffix in _CLIP_SUFFIXES:
            raise
        raise ClipError(f"{source} is no run or bag, nor a clip: {error}") from error


def read_recorded(
    source: str, robot: RobotSource, told: Callable[[Sequence[Recording]], None]
) -> tuple[Recording, ...]:
    """The recordings of a run or a bag, none of a clip; arguments and errors: `read_source`."""
    path, suffixes = Path(source), (*FILE_SUFFIXES, *_CLIP_SUFFIXES)
    refuse_other_kind(path, "a run, a bag or a clip", suffixes, RecordingError)
    if not (path.is_dir() or {*path.suffixes} & {*SUFFIXES.values()}):
        return ()
    recordings = read_any(path, robot)
    told(recordings)
    return recordings


def of_clip(character: Character, name_or_path: str) -> Trajectories:
    """The motion of a clip, as it is tracked.

    Raises:
        ClipError: there is no such clip, or it does not fit the character.
    """
    frames = read_clip(character, name_or_path)
    durations = np.diff(frames.times)
    usual = float(np.median(durations))
    equal = np.abs(durations - usual).max() <= _DURATION_TOLERANCE * usual
    rate = len(durations) / float(frames.times[-1]) if equal else round(1.0 / usual)
    configurations = GeneralizedPosition(frames.positions, frames.orientations_xyzw)
    trajectory = CharacterTrajectory(character.name, character, configurations)
    return Trajectories(frames.times, rate, (trajectory,))


def of_recordings(recordings: Sequence[Recording]) -> Trajectories:
    """The motion of the characters of one world, and that of the balls in it.

    Raises:
        RecordingError: they are of several worlds, or have no tick in common.
    """
    scene = make_scene(recordings)
    rate = (len(scene.times) - 1) / float(scene.times[-1]) if len(scene.times) > 1 else 1.0
    characters = tuple(
        CharacterTrajectory(
            recording.name or recording.character.name,
            recording.character,
            recording.layout.configuration(recording.position),
            color_number,
        )
        for recording, color_number in zip(scene.recordings, scene.color_numbers, strict=True)
    )
    return Trajectories(
        times=scene.times,
        rate=rate / ceil(rate / _HIGHEST_RATE - 1e-9),
        characters=characters,
        balls=tuple(_balls(scene)),
        cuts=scene.episode_rows[1:],
        has_plane=scene.ground,
    )


def _balls(scene: RecordedScene) -> Iterator[BallTrajectory]:
    """Each ball of each episode."""
    states = scene.recordings[0].balls
    if not states:
        return
    ends = [*scene.episode_rows.tolist(), len(states)]
    for number, (begin, end) in enumerate(pairwise(ends), start=1):
        known = {row: each for row in range(begin, end) if (each := states[row]) is not None}
        names = list(dict.fromkeys(name for each in known.values() for name in each.names))
        shapes = scene.ball_shapes(end - 1, names)
        poses = np.full((len(names), len(states), 7), np.nan)
        for row, each in known.items():
            poses[[names.index(name) for name in each.names], row] = each.motion[:, :7]
        poses[np.linalg.norm(poses[..., :3], axis=-1) > _AWAY_DISTANCE] = np.nan
        prefix = f"episode_{number}_" if len(ends) > 2 else ""
        for name, shape, pose in zip(names, shapes, poses, strict=True):
            yield BallTrajectory(prefix + name, shape, pose[:, :3], pose[:, 3:])
