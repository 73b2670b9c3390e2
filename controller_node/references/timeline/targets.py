"""Layers by inverse kinematics: a limb that reaches for a point, and a head that looks at one."""

from collections.abc import Callable

import numpy as np

from controller_node.references.base import Reference
from controller_node.references.curve import Curve, smooth_knots
from controller_node.references.posing import Posing, Target
from controller_node.references.timeline.description import TargetEntry
from controller_node.references.timeline.layers import LayeredReference, Span
from msgs_config.arrays import BoolArray
from msgs_config.character.layout import GeneralizedPosition, JointType
from msgs_config.character.model import Character, Vector
from msgs_config.errors import MotionError
from msgs_config.geometry import rotations

_KNOTS_PER_SECOND = 60.0
_SHORT = 0.02  # m that a point may be missed by, before it is said
_HEADS = ("head", "neck")  # how the link that looks may be called
_AHEAD = np.array((1.0, 0.0, 0.0))  # in the world, of a character that was not placed

_Want = Callable[[GeneralizedPosition], Target]
"""What is wanted in a pose of what is beneath."""


class TargetLayers:
    """Makes the layers of a character's targets; `warnings` are of what it cannot reach."""

    def __init__(self, character: Character) -> None:
        self._character, self._posing = character, Posing(character)
        self._links = {link.name: link for link in character.links}
        self.warnings = list[str]()

    def reach(self, beneath: Reference, entry: TargetEntry) -> LayeredReference:
        """A layer in which a link is at a point. Raises MotionError if there is no such link."""
        if not entry.link:
            raise MotionError(f"{entry.place}: link is missing; it must be the one that reaches")
        target = Target(self._checked(entry, entry.link), entry.point)
        chain = self._posing.chain(entry.link)
        if not chain.any():
            raise MotionError(f"{entry.place}: no joint moves '{entry.link}' alone")
        return self._layer(beneath, entry, chain, lambda pose: target)

    def look(self, beneath: Reference, entry: TargetEntry) -> LayeredReference:
        """A layer in which a head faces a point. Raises MotionError if there is no such link."""
        heads = [name for word in _HEADS for name in self._links if word in name]
        if not (entry.link or heads):
            raise MotionError(f"{entry.place}: link is missing; it must be the one that looks")
        link = self._checked(entry, entry.link or heads[0])
        joint = self._links[link].joint
        if joint.type in (JointType.FIXED, JointType.FLOATING):
            raise MotionError(f"{entry.place}: no joint turns '{link}'")
        ahead = self._ahead(link)
        free = self._character.layout.mask([joint.name])
        return self._layer(
            beneath, entry, free, lambda pose: self._posing.aim(pose, link, ahead, entry.point)
        )

    def _checked(self, entry: TargetEntry, link: str) -> str:
        try:
            self._posing.chain(link)
        except MotionError as error:
            raise MotionError(f"{entry.place}: {error}") from error
        return link

    def _ahead(self, link: str) -> Vector:
        """The direction, in a link's frame, that is ahead at rest."""
        rest = self._character.layout.configuration(np.array(self._character.rest_position))
        _, turn = self._posing.frame(rest, link)
        world = rotations.rotate(rotations.about_z(self._character.placement.yaw), _AHEAD)
        x, y, z = rotations.rotate(rotations.conjugate(turn), world).tolist()
        return x, y, z

    def _layer(
        self, beneath: Reference, entry: TargetEntry, free: BoolArray, want: _Want
    ) -> LayeredReference:
        """The layer of a limb's poses, some each second; each begins near the one before.

        One comes before and one after the time of the entry, where the path is at rest.
        """
        layout = self._character.layout
        count = max(round((entry.until - entry.at) * _KNOTS_PER_SECOND), 1)
        times = np.linspace(entry.at, entry.until, count + 1)
        step = times[1] - times[0]
        before_it = [entry.at - step] if entry.at > step else []
        times = np.concatenate((before_it, times, [entry.until + step]))
        before, poses, missed = None, list[GeneralizedPosition](), 0.0
        for time in times.tolist():
            pose = beneath.sample(time).configuration
            found = self._posing.fit(pose, [want(pose)], free=free, start=before)
            before, missed = found.pose, max(missed, found.residual)
            poses.append(found.pose)
        if missed > _SHORT:
            what = f"'{entry.link}' stays up to {missed:.2f} m" if entry.link else "the head turns"
            self.warnings.append(f"{entry.place}: {what} short of its point")
        configurations = GeneralizedPosition(
            np.array([pose.position for pose in poses]),
            np.array([pose.orientations_xyzw for pose in poses]),
        )
        path = Curve(layout, smooth_knots(layout, times, configurations, loops=False))
        span = Span(entry.at, entry.until, entry.come, entry.go)
        return LayeredReference(layout, beneath, path, np.flatnonzero(free), span)
