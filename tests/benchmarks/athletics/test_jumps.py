"""A jump of the machine `jump`, as its benchmark measures it."""

import math
from dataclasses import replace

import pytest

from benchmarks.athletics.jumps import FLIGHT, SEARCHED, jump, search_cost, small_push
from benchmarks.athletics.search import place_of
from controller_node.behaviours.state_machine.file import machine_path, read_content, read_machine


def test_nudges_are_small_and_of_their_seeds() -> None:
    pushes = [small_push(seed) for seed in range(1, 41)]

    forces, times = zip(*(text.removeprefix("root:").split("@") for text in pushes), strict=True)
    sizes = [math.hypot(*(float(number) for number in force.split(",")[:2])) for force in forces]
    assert 10.0 <= min(sizes) < 12.0 and 28.0 < max(sizes) <= 30.0
    assert min(float(time) for time in times) < 0.8 and max(float(time) for time in times) > 2.8
    assert small_push(1) == pushes[0] and len(set(pushes)) == 40


@pytest.mark.slow
@pytest.mark.parametrize("push", ["", small_push(2)])
def test_it_flies_for_a_quarter_of_a_second_and_stands(push: str) -> None:
    seen = jump(read_machine("jump"), 0, push)

    assert seen.succeeded
    # a body that flies for T rises by less than g T^2 / 8 where it lands with bent knees
    assert FLIGHT < seen.flight < 0.5
    assert 0.03 < seen.rise < 9.81 * seen.flight**2 / 8.0 + 0.05


def test_a_jump_that_has_no_flight_does_not_count() -> None:
    machine = read_machine("jump")
    stays = replace(machine.states["stand"], ends=())
    standing = replace(machine, states={"stand": stays})

    seen = jump(standing, 0, "")

    assert search_cost(standing, [""]) >= 9.0  # no flight at all costs ten
    assert seen.stands and seen.flight < 0.01  # of the first ticks, put down
    assert not seen.succeeded


def test_a_search_moves_numbers_that_the_file_has() -> None:
    content = read_content(machine_path("jump"))

    for text in SEARCHED:
        place, step = text.split("=")
        holder, key = place_of(content, place)
        assert isinstance(holder[key], float) and 0.0 < float(step) < 1.0
