"""Keyframes as a reference: poses at times, and the path between them."""

from pathlib import Path

import numpy as np

from controller_node.references.base import REFERENCES, Motion, ReferenceState
from controller_node.references.curve import Curve, Knots, closed, from_and_to_rest, smooth_knots
from controller_node.references.files.keyframes import Keyframes, read_keyframes
from controller_node.references.limits import JointLimits
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import MotionError, one_of
from msgs_config.file_kinds import refuse_other_kind
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter

KEYFRAMES_DIRECTORY = Path(__file__).parent / "data"

_SHARES = np.linspace(0.0, 1.0, 65)  # shares of a segment, where its path is compared with limits
_LIMIT_TOLERANCE = 1e-6  # rad or m beyond a limit that lead to a warning
_FILES = (".yaml", ".yml")


class KeyframesReference:
    """Keyframes in time.

    A loop goes on from the last keyframe to the first one of the next period, and is periodic from
    time 0 on. Else the first keyframe is held until its time comes, and the last one from then on;
    one that moves comes from rest, or to rest, within `curve.REST_TIME`.
    """

    def __init__(self, layout: JointLayout, keyframes: Keyframes) -> None:
        self._curve = curve_through(layout, keyframes)
        self._first = float(keyframes.times[0])
        self._period = keyframes.period

    def sample(self, time: float) -> ReferenceState:
        """The desired state `time` seconds after the episode's first state."""
        if self._period is not None:
            time = (time - self._first) % self._period
            if time >= self._period:  # the modulo of a tiny negative time can round up to it
                time = 0.0
        return self._curve.sample(time)


def curve_through(layout: JointLayout, keyframes: Keyframes) -> Curve:
    """The path through keyframes; that of a loop is one period, from its first keyframe on.

    A smooth path is continuous to the acceleration; `smooth_knots` says how it moves.
    """
    times, configurations = keyframes.times, keyframes.configurations
    own = keyframes.velocities, keyframes.accelerations
    loops, is_still = keyframes.period is not None, all(each is None for each in own)
    if keyframes.period is not None:
        times = np.append(times - times[0], keyframes.period)
        configurations = GeneralizedPosition(
            closed(configurations.position), closed(configurations.orientations_xyzw)
        )
        velocities, accelerations = (None if each is None else closed(each) for each in own)
        own = velocities, accelerations
    if not keyframes.smooth or (len(times) == 1 and is_still):
        return Curve(layout, Knots(times, configurations))
    knots = smooth_knots(layout, times, configurations, *own, loops=loops)
    return Curve(layout, knots if loops else from_and_to_rest(knots))


def overshoots(character: Character, keyframes: Keyframes) -> tuple[str, ...]:
    """A warning of each joint that the path leads out of its limits between two keyframes."""
    if len(keyframes.times) == 1:
        return ()
    limits, curve = JointLimits(character), curve_through(character.layout, keyframes)
    begin = keyframes.times[0] if keyframes.period is not None else 0.0
    at_keyframes = keyframes.configurations.position
    lower = np.minimum(limits.lower, at_keyframes.min(axis=0))  # a rest pose may lie beyond limits
    upper = np.maximum(limits.upper, at_keyframes.max(axis=0))
    warnings = []
    for index in np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist():
        times, values = curve.coordinate(index, _SHARES)
        beyond = np.maximum(lower[index] - values, values - upper[index])
        beyond[begin + times < 0.0] = 0.0
        worst = np.unravel_index(beyond.argmax(), beyond.shape)
        if beyond[worst] > _LIMIT_TOLERANCE:
            warnings.append(
                f"the path between keyframes leaves the limits of "
                f"'{character.layout.dof_names[index]}', {limits.text(index)}, by "
                f"{beyond[worst]:.2g} {limits.unit(index)} at {begin + times[worst]:.3g} s; one "
                "more keyframe there, or 'interpolation: linear', keeps it within"
            )
    return tuple(warnings)


class KeyframesSettings(Settings):
    """The keyframes that are tracked."""

    keyframes: str = parameter("", "name of shipped keyframes, or path of a .yaml file")


@REFERENCES.register("keyframes", KeyframesSettings)
def _keyframes(character: Character, values: Values) -> Motion:
    keyframes = read_keyframes(
        character, str(keyframes_path(KeyframesSettings.of(values).keyframes))
    )
    reference = KeyframesReference(character.layout, keyframes)
    return Motion(reference, overshoots(character, keyframes))


def keyframes_path(name_or_path: str) -> Path:
    """The file of shipped keyframes, or the path itself. Raises MotionError if there are none."""
    refuse_other_kind(Path(name_or_path), "a file of keyframes (.yaml)", _FILES, MotionError)
    if name_or_path.endswith(_FILES):
        return Path(name_or_path)
    shipped = sorted(path.stem for path in KEYFRAMES_DIRECTORY.glob("*.yaml"))
    if name_or_path not in shipped:
        raise MotionError(f"{one_of('keyframes', name_or_path, shipped)}, or the path of a .yaml")
    return KEYFRAMES_DIRECTORY / f"{name_or_path}.yaml"
