"""Contacts are found when they are read, and are those of the tick, whatever was asked before.

The wrenches that they are compared with are summed here, of the engine's contact points right after
its step and the places in which the links were right before it.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from importlib import import_module
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from msgs_config.arrays import FloatArray
from msgs_config.character.model import UrdfOptions
from msgs_config.errors import CharacterError
from msgs_config.messages.throw import ProjectileThrow
from sim_node.physics.mujoco.body import MujocoBody
from sim_node.physics.simulated_character import Contacts, SimulatedCharacter
from sim_node.physics.simulation import Simulation
from sim_node.physics.wrenches import ExternalWrench
from tests.support.engines import pybullet
from tests.support.physics import (
    character,
    joint_simulation,
    simulation,
)

pytestmark = pytest.mark.usefixtures("engine")

CROWD = {"characters": ["one", "other"], "other.placement": [0.25, 0.1, 0.0, 2.0]}


def centres(body: Any) -> dict[int, FloatArray]:
    """Where the centres of mass of the engine's links are now, by its numbers of them."""
    if isinstance(body, MujocoBody):
        model, data = body._world.model, mujoco.MjData(body._world.model)
        data.qpos[:] = body._world.data.qpos
        mujoco.mj_kinematics(model, data)
        links = body.place.links
        return {row: data.xipos[row].copy() for row in range(links.start, links.stop)}
    client, count = body._client, pybullet.getNumJoints(body._body, physicsClientId=body._client)
    base = pybullet.getBasePositionAndOrientation(body._body, physicsClientId=client)[0]
    found = {-1: np.array(base)}
    for link in range(count):
        state = pybullet.getLinkState(
            body._body, link, computeForwardKinematics=1, physicsClientId=client
        )
        found[link] = np.array(state[0])
    return found


def expected_wrenches(body: Any, before: dict[int, FloatArray]) -> FloatArray:
    """Net wrenches (links, 6) of the engine's contact points, about where the links were before."""
    if isinstance(body, MujocoBody):
        return expected_of_mujoco(body, before)
    wrenches = np.zeros((len(before), 6))
    for point in pybullet.getContactPoints(physicsClientId=body._client):
        force = point[9] * np.array(point[7])
        force += point[10] * np.array(point[11]) + point[12] * np.array(point[13])
        for own, link, at, sign in (
            (point[1], point[3], np.array(point[5]), 1.0),
            (point[2], point[4], np.array(point[6]), -1.0),
        ):
            if own == body._body:
                torque = np.cross(at - before[link], sign * force)
                wrenches[body._row[link]] += np.concatenate((sign * force, torque))
    return wrenches


def expected_of_mujoco(body: MujocoBody, before: dict[int, FloatArray]) -> FloatArray:
    """By the forces of the solver's rows: of each contact one normal to the surfaces, two along."""
    model, data = body._world.model, body._world.data
    wrenches = {link: np.zeros(6) for link in before}
    for contact in data.contact:
        row = contact.efc_address
        force = contact.frame.reshape(3, 3).T @ data.efc_force[row : row + 3]
        for shape, sign in zip(contact.geom, (-1.0, 1.0), strict=True):
            link = int(model.geom_bodyid[shape])
            if row >= 0 and link in before:
                torque = np.cross(contact.pos - before[link], sign * force)
                wrenches[link] += np.concatenate((sign * force, torque))
    return np.array([wrenches[link] for link in sorted(wrenches)])


def read_at_once(run: Simulation, one: SimulatedCharacter) -> Contacts | None:
    return one.contacts


def read_after_frames(run: Simulation, one: SimulatedCharacter) -> Contacts | None:
    for each in run.characters:
        each.link_frames()
        each.base_frame()
    return one.contacts


def read_twice(run: Simulation, one: SimulatedCharacter) -> Contacts | None:
    first = one.contacts
    one.link_frames()
    assert one.contacts is first
    return first


def read_from_a_snapshot(run: Simulation, one: SimulatedCharacter) -> Contacts | None:
    saved = run.snapshot()
    run.load_snapshot(saved)
    return one.contacts


WAYS = [read_at_once, read_after_frames, read_twice, read_from_a_snapshot]
Reading = Callable[[Simulation, SimulatedCharacter], Contacts | None]


@pytest.mark.parametrize("read", WAYS, ids=lambda way: way.__name__)
@pytest.mark.parametrize("name", ["humanoid", "laikago", "franka_panda"])
def test_they_are_those_of_the_engines_last_step_however_late_they_are_read(
    name: str, read: Reading
) -> None:
    rng, size = np.random.default_rng(3), character(name).layout.size
    ball = ProjectileThrow(1.0, 0.1, (0.5, 0.0, 1.0), (-6.0, 0.0, 0.0))
    largest = 0.0
    with simulation(name) as run:
        run.watches_contacts = True
        (one,) = run.characters
        for tick in range(150):
            push = ExternalWrench(0, rng.normal(size=6), np.zeros(3), 0, 1)
            before = centres(one._body)
            run.step([rng.normal(size=size)], [(push,) if tick % 3 else ()], [ball] * (tick == 20))
            expected = expected_wrenches(one._body, before)
            contacts = read(run, one)
            assert contacts is not None
            np.testing.assert_allclose(contacts.wrenches, expected, rtol=1e-12, atol=1e-9)
            largest = max(largest, float(np.abs(expected).max()))
    assert largest > 1.0


def test_of_several_characters_each_has_its_own_also_if_one_alone_is_read() -> None:
    efforts = [np.zeros(each.layout.size) for each in joint_simulation(CROWD).characters]
    felt = np.zeros(2)
    with joint_simulation(CROWD) as run:
        run.watches_contacts = True
        one, other = run.characters
        for tick in range(200):
            before = centres(other._body)
            run.step(efforts)
            expected = expected_wrenches(other._body, before)
            if tick % 2:
                assert one.contacts is not None
                one.link_frames()
            assert other.contacts is not None
            np.testing.assert_allclose(other.contacts.wrenches, expected, rtol=1e-12, atol=1e-9)
            felt = np.maximum(felt, [np.abs(each.contacts.wrenches).max() for each in (one, other)])
    assert (felt > 1.0).all()


def test_who_reads_none_looks_for_none(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    looked = []
    place = {"bullet": "BulletWorld._find_touched", "mujoco": "sum_contacts"}[engine]
    *within, name = place.split(".")
    owner = reduce(getattr, within, import_module(f"sim_node.physics.{engine}.world"))
    find = getattr(owner, name)

    def counted(*arguments: Any) -> Any:
        looked.append(arguments)
        return find(*arguments)

    monkeypatch.setattr(owner, name, counted)
    with simulation("humanoid") as run:
        run.watches_contacts = True
        for _ in range(5):
            run.advance(np.zeros(run.layout.size))
        assert not looked
        for _ in range(3):
            assert run.simulated.contacts is run.simulated.contacts
        assert len(looked) == 1


def test_they_can_be_read_after_the_end_and_a_reset_forgets_them() -> None:
    with simulation("humanoid") as run:
        run.watches_contacts = True
        while run.simulated.contacts is None or not run.simulated.contacts.touching.any():
            run.advance(np.zeros(run.layout.size))
        run.advance(np.zeros(run.layout.size))
        last = run.simulated
        run.reset()
        assert last.contacts is not None
        assert not last.contacts.touching.any()
        for _ in range(150):
            run.advance(np.zeros(run.layout.size))
    assert last.contacts is not None
    assert last.contacts.touching.any()


def test_a_reset_that_fails_leaves_what_can_be_closed_with_its_contacts() -> None:
    with simulation("humanoid") as run:
        run.watches_contacts = True
        run.step([np.zeros(run.characters[0].layout.size)])
        terrain = UrdfOptions(Path("/nowhere.urdf"), "<robot name='r'><link name='l'>", True)

        with pytest.raises(CharacterError):
            run.reset(replace(run.settings.world, terrain=terrain))

        assert run.characters[0].contacts is not None
        run.close()
