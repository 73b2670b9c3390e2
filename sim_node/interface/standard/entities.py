"""The entities of a world: its characters, and the balls and boxes in it. No ROS in here."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.errors import CommandError
from msgs_config.geometry import rotations
from msgs_config.messages.projectiles import ball_names
from msgs_config.messages.throw import ProjectileThrow
from sim_node.interface.standard.codes import Category, Code, RefusedRequestError, SpawnCode
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.physics.simulation import Simulation

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
_LONGEST_FILTER = 200  # characters


@dataclass(frozen=True)
class EntityMotion:
    """Where an entity is in the world, and how it moves there."""

    position: FloatArray  # (3,) m
    orientation_xyzw: FloatArray  # (4,)
    linear: FloatArray  # (3,) m/s
    angular: FloatArray  # (3,) rad/s


class Entities:
    """Finds entities by name, and adds some.

    A character alone in the world has the name of its file, several have their own; what was thrown
    has its name on `thrown`, unless it was spawned with another one.
    """

    def __init__(self, simulation: Simulation, throw: Callable[[ProjectileThrow], object]) -> None:
        """`throw` has a ball or box let go with the next tick, or raises CommandError."""
        self._simulation, self._throw = simulation, throw
        self._spawned: list[tuple[ProjectileThrow, str]] = []  # in this episode

    def begin_episode(self) -> None:
        """Forget what was spawned in the episode before."""
        self._spawned.clear()

    @property
    def characters(self) -> dict[str, SimulatedCharacter]:
        """The characters by name."""
        return {
            each.setup.name or each.character.name: each for each in self._simulation.characters
        }

    def _balls(self) -> dict[str, int | ProjectileThrow]:
        """What was thrown, by name: its number, or the throw itself where that is yet to begin."""
        balls = self._simulation.balls
        given = {id(throw): name for throw, name in self._spawned}
        found: dict[str, int | ProjectileThrow] = {
            given.get(id(throw), default): number
            for number, (throw, default) in enumerate(zip(balls, ball_names(balls), strict=True))
        }
        thrown = {id(throw) for throw in balls}
        return found | {name: throw for throw, name in self._spawned if id(throw) not in thrown}

    def names(self, filters: Any) -> list[str]:
        """The names that pass `EntityFilters`.

        Raises:
            RefusedRequestError: a filter cannot be applied.
        """
        if filters.tags.tags:
            raise RefusedRequestError(
                Code.FEATURE_UNSUPPORTED, "no entity has tags; leave 'tags' empty"
            )
        if filters.bounds.type:
            raise RefusedRequestError(
                Code.FEATURE_UNSUPPORTED, "entities are not filtered by bounds"
            )
        if len(filters.filter) > _LONGEST_FILTER:
            raise RefusedRequestError(
                Code.OPERATION_FAILED, f"'filter' is longer than {_LONGEST_FILTER}"
            )
        try:
            pattern = re.compile(filters.filter)
        except re.error as error:
            raise RefusedRequestError(
                Code.OPERATION_FAILED, f"'filter' is no regular expression: {error}"
            ) from error
        wanted = {int(each.category) for each in filters.categories} or set(Category)
        kinds = dict.fromkeys(self.characters, Category.ROBOT)
        kinds |= dict.fromkeys(self._balls(), Category.DYNAMIC_OBJECT)
        return [name for name, kind in kinds.items() if kind in wanted and pattern.search(name)]

    def motion(self, name: str) -> EntityMotion:
        """Where an entity is: of a character its base link.

        Raises:
            RefusedRequestError: there is none of that name.
        """
        if (character := self.characters.get(name)) is not None:
            return _motion_of(character)
        ball = self._balls().get(name)
        if ball is None:
            raise self.unknown(name)
        if isinstance(ball, ProjectileThrow):
            turn, still = np.array(ball.turn_xyzw), np.zeros(3)
            return EntityMotion(np.array(ball.position), turn, np.array(ball.velocity), still)
        row = self._simulation.ball_motion()[ball]
        return EntityMotion(row[:3], row[3:7], row[7:10], row[10:13])

    def unknown(self, name: str) -> RefusedRequestError:
        """That there is no entity of a name."""
        known = ", ".join([*self.characters, *self._balls()])
        return RefusedRequestError(Code.NOT_FOUND, f"no entity {name[:100]!r}; there are: {known}")

    def spawn(self, name: str, throw: ProjectileThrow, *, renames: bool) -> str:
        """Let a ball or box go with the next tick; its name, another one if it `renames`.

        Raises:
            RefusedRequestError: the name cannot be, or there are too many.
        """
        taken = {*self.characters, *self._balls()}
        if not renames and not _NAME.fullmatch(name):
            raise RefusedRequestError(
                SpawnCode.NAME_INVALID,
                f"the name is {name[:100]!r}; it must be at most 64 letters, digits and '_', and "
                "begin with a letter",
            )
        if not renames and name in taken:
            raise RefusedRequestError(SpawnCode.NAME_NOT_UNIQUE, f"{name!r} is there already")
        base = name if _NAME.fullmatch(name) else "box" if throw.size else "ball"
        number, found = 1, base
        while found in taken:
            number += 1
            found = f"{base}_{number}"
        try:
            self._throw(throw)
        except CommandError as error:
            raise RefusedRequestError(Code.OPERATION_FAILED, str(error)) from error
        self._spawned.append((throw, found))
        return found


def _motion_of(character: SimulatedCharacter) -> EntityMotion:
    origin, turn = character.base_frame()
    linear = angular = np.zeros(3)
    if character.layout.has_floating_base:  # whose angular velocity is in the base's own axes
        velocity = character.state.velocity
        linear, angular = velocity[:3], rotations.rotate(turn, velocity[3:6])
    return EntityMotion(np.array(origin), np.array(turn), linear, angular)
