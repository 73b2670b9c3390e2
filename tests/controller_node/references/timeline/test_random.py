"""Timelines at random: each can be tracked from its beginning on, or is refused in one line."""

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller_node import parameters as for_controller
from controller_node.references.timeline.file import read_timeline
from controller_node.references.timeline.motion import timeline_motion
from msgs_config.errors import ActuatedCharactersError
from tests.support.motion import assert_consistent, loaded

HUMANOID, LAYOUT = loaded("humanoid")
CLIPS = st.sampled_from(["walk", "kick", "getup_facedown", "backflip"])
LINKS = st.sampled_from(["right_wrist", "left_elbow", "left_ankle"])
SHARES = st.floats(0.0, 1.0)
TIMES = st.floats(0.0, 3.0)
LENGTHS = st.floats(0.05, 2.0)
NECK = st.fixed_dictionaries({f"neck_{axis}": st.floats(-0.6, 0.6) for axis in "xyz"})
ELBOW = st.fixed_dictionaries({"right_elbow": st.floats(0.0, 2.5)})
ROOT = st.fixed_dictionaries(
    {f"root_{axis}": st.floats(-1.0, 1.0) for axis in ("x", "y", "z", "rx", "ry", "rz")}
)
ODD = [-1.0, 0, 1e9, float("nan"), "a", [], {}, None]


@st.composite
def spans(draw: st.DrawFn) -> dict[str, Any]:
    at = draw(TIMES)
    return {"at": at, "until": at + draw(LENGTHS)}


@st.composite
def layers(draw: st.DrawFn) -> dict[str, Any]:
    poses, at = [], draw(TIMES)
    kinds = st.one_of(NECK, ELBOW, ROOT)
    for _ in range(draw(st.integers(1, 4))):
        ease = draw(st.sampled_from(["smooth", "rest", "velocity"]))
        pose = draw(kinds)
        if ease == "velocity":
            velocity = {name: draw(st.floats(-20.0, 20.0)) for name in pose}
            acceleration = {name: draw(st.floats(-200.0, 200.0)) for name in pose}
            rates = {"velocity": velocity, "acceleration": acceleration}
            poses.append({"at": at, "pose": pose, **rates})
        else:
            poses.append({"at": at, "pose": pose, "ease": ease})
        at += draw(LENGTHS)
    out = draw(st.one_of(SHARES, st.just("never")))
    return {"in": draw(SHARES), "out": out, "poses": poses}


@st.composite
def on_the_ground(draw: st.DrawFn) -> dict[str, Any]:
    """Clips and steering one after another."""
    tracks: dict[str, Any] = {"clips": [], "steering": []}
    at = draw(TIMES)
    for _ in range(draw(st.integers(0, 3))):
        until = at + draw(LENGTHS)
        if draw(st.booleans()):
            entry = {"at": at, "clip": draw(CLIPS), "from": draw(SHARES), "blend": draw(SHARES)}
            if draw(st.booleans()):
                place = draw(st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2))
                entry |= {"to": 1.2, "place": place, "heading": draw(st.floats(-3.0, 3.0))}
            tracks["clips"].append(entry)
        else:
            velocity = [draw(st.floats(0.0, 2.0)), 0.0, draw(st.floats(-0.5, 0.5))]
            tracks["steering"].append({"at": at, "until": until, "velocity": velocity})
        at = until
    return tracks


@st.composite
def targets(draw: st.DrawFn, link: bool) -> dict[str, Any]:
    point = draw(st.lists(st.floats(-0.5, 1.5), min_size=3, max_size=3))
    named = {"link": draw(LINKS)} if link else {}
    return {**draw(spans()), "point": point, "in": draw(SHARES), "out": draw(SHARES), **named}


@st.composite
def timelines(draw: st.DrawFn) -> dict[str, Any]:
    """Timelines that are right; in a third of them one value is another one."""
    content = draw(on_the_ground())
    content["keys"] = draw(st.lists(layers(), max_size=3))
    content["reach"] = draw(st.lists(targets(link=True), max_size=1))
    content["look"] = draw(st.lists(targets(link=False), max_size=1))
    places = list(places_of(content))
    if places and draw(st.integers(0, 2)) == 2:
        holder, key = draw(st.sampled_from(places))
        holder[key] = draw(st.sampled_from(ODD))
    return content


def places_of(value: Any) -> Iterator[tuple[Any, Any]]:
    """All that is in lists and mappings, with its place."""
    if isinstance(value, (dict, list)):
        for key in value if isinstance(value, dict) else range(len(value)):
            yield value, key
            yield from places_of(value[key])


def check(content: dict[str, Any]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "moves.yaml"
        file.write_text(yaml.safe_dump(content), encoding="utf-8")
        given_values = {"character": "humanoid", "reference": "timeline", "timeline": str(file)}
        try:
            values = for_controller.resolve_for(HUMANOID, given_values)
            reference = timeline_motion(HUMANOID, values, read_timeline(str(file))).reference
        except ActuatedCharactersError as error:
            assert "\n" not in str(error) and str(error).startswith(str(file))
            return
    before = reference.sample(0.0)
    for tick in range(1, 1000):
        state = reference.sample(tick / 240)
        assert np.isfinite(state.velocity).all() and np.isfinite(state.acceleration).all()
        assert_consistent(LAYOUT, state)
        apart = LAYOUT.difference(before.configuration, state.configuration)
        assert math.isfinite(apart.sum())
        before = state


@pytest.mark.slow
@given(timelines())
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
def test_a_random_timeline_is_tracked_or_refused_in_a_line(content: dict[str, Any]) -> None:
    check(content)


@pytest.mark.nightly
@given(timelines())
@settings(max_examples=500, deadline=None, suppress_health_check=list(HealthCheck))
def test_five_hundred_random_timelines_are_tracked_or_refused_in_a_line(
    content: dict[str, Any],
) -> None:
    check(content)
