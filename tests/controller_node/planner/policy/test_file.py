"""A policy's file: what is written is read, and whatever is wrong with it is one clear line."""

import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from controller_node.parameters import resolve_for
from controller_node.planner.factory import check_planning, make_planner
from controller_node.planner.policy.file import (
    Policy,
    find_policy,
    read_policy,
    shipped_policies,
    write_policy,
)
from msgs_config.errors import ActuatedCharactersError, ConfigurationError
from tests.support.physics import character
from tests.support.policies import random_policy, write_random_policy

HUMANOID, LAIKAGO = character("humanoid"), character("laikago")
Content = dict[str, Any]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a policy of the humanoid."""
    return write_random_policy(tmp_path_factory.mktemp("policies") / "whole.npz", HUMANOID)


def arrays(policy: Policy) -> list[Any]:
    """All that it computes with."""
    return [*policy.network, *policy.value, *policy.scales, policy.ahead, policy.unit]


def test_what_is_written_is_read_to_the_bit(tmp_path: Path) -> None:
    written, path = random_policy(HUMANOID), tmp_path / "one.npz"
    write_policy(path, written)

    read = read_policy(str(path), HUMANOID)

    assert read.about == written.about
    assert (read.hold, read.rate_hz, read.largest) == (8, 240, 2.0)
    for found, wanted in zip(arrays(read), arrays(written), strict=True):
        assert np.asarray(found).dtype == np.asarray(wanted).dtype
        assert np.asarray(found).tobytes() == np.asarray(wanted).tobytes()
    write_policy(tmp_path / "again.npz", read)
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_what_is_shipped_is_found_by_its_name() -> None:
    for name in shipped_policies():
        with np.load(find_policy(name), allow_pickle=False) as content:
            about = json.loads(str(content["about"]))
        assert read_policy(name, character(about["character"])).about == about


def test_a_file_is_found_in_the_users_home(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(whole.parent))
    assert find_policy("~/whole.npz") == whole


def test_layers_and_types_of_others_are_taken_where_they_fit(whole: Path, tmp_path: Path) -> None:
    with np.load(whole) as archive:
        content = {name: archive[name] for name in archive.files}
    other = {
        name: np.asfortranarray(array.astype(float)) if array.dtype == np.float32 else array
        for name, array in content.items()
    }
    np.savez_compressed(tmp_path / "other.npz", **{**other, "ahead": other["ahead"].astype("i4")})

    read, plain = (read_policy(str(path), HUMANOID) for path in (tmp_path / "other.npz", whole))

    for found, wanted in zip(arrays(read), arrays(plain), strict=True):
        assert np.asarray(found).tobytes() == np.asarray(wanted).tobytes()
        assert np.asarray(found).flags.c_contiguous


class Opened:
    """Fails where it is unpickled."""

    def __reduce__(self) -> tuple[object, ...]:
        return pytest.fail, ("it was unpickled",)


def said(**changes: object) -> Callable[[Content], object]:
    """Another `about`; None leaves something out."""

    def change(content: Content) -> None:
        about = {**json.loads(str(content["about"])), **changes}
        about = {name: value for name, value in about.items() if value is not None}
        content["about"] = np.array(json.dumps(about))

    return change


def with_array(name: str, change: Callable[[Any], object]) -> Callable[[Content], object]:
    """Another array."""
    return lambda content: content.update({name: np.asarray(change(content[name]))})


def poked(value: float) -> Callable[[Any], object]:
    """An array with another last entry."""
    return lambda array: np.append(array.ravel()[:-1], value).reshape(array.shape)


ABOUT = "about"
WRONG: Mapping[str, tuple[Callable[[Content], object], str]] = {
    "pickled": (with_array("unit", lambda _: np.array([Opened()])), "Object arrays cannot be"),
    "pickled about": (with_array(ABOUT, lambda _: np.array(Opened())), "Object arrays cannot be"),
    "no about": (lambda content: content.pop(ABOUT), "it has no 'about'"),
    "no weights": (lambda content: content.pop("value.bias_3"), "it has no 'value.bias_3'"),
    "no scales": (lambda content: content.pop("deviation"), "it has no 'deviation'"),
    "no JSON": (with_array(ABOUT, lambda _: "{"), "Expecting property name"),
    "a list": (with_array(ABOUT, lambda _: "[1]"), "'about' must be a mapping"),
    "a number": (with_array(ABOUT, lambda _: 3.0), "'about' must be a mapping"),
    "deep": (with_array(ABOUT, lambda _: 100_000 * "["), "recursion"),
    "a later format": (said(format=2, hold=None), "its format is 2; this version reads 1"),
    "no format": (said(format=None), "its format is None; this version reads 1"),
    "no hold": (said(hold=None), "'hold' in 'about' must be a whole number"),
    "no names": (said(dofs=[1, 2]), "'dofs' in 'about' must be a list of names"),
    "no clips": (said(gait="walk"), "'gait' in 'about' must be a list of names"),
    "half a tick": (said(hold=0.5), "'hold' in 'about' must be a whole number"),
    "no ticks": (said(hold=0), "'hold', 'rate' and 'largest' in 'about' must be above 0"),
    "backwards": (said(rate=-240), "'hold', 'rate' and 'largest' in 'about' must be above 0"),
    "no largest": (said(largest=float("nan")), "'largest' in 'about' must be above 0, and finite"),
    "no bound": (said(largest=float("inf")), "'largest' in 'about' must be above 0, and finite"),
    "no mass": (said(mass=0), "'mass' in 'about' must be above 0"),
    "upwards": (said(gravity=-9.81), "'gravity' at least 0"),
    "never calm": (said(calm=0.0), "'calm' in 'about' must be above 0"),
    "no gains": (lambda content: content.pop("damping"), "it has no 'damping'"),
    "too few gains": (with_array("stiffness", lambda array: array[1:]), "(its 'stiffness')"),
    "NaN": (with_array("policy.weights_2", poked(np.nan)), "'policy.weights_2' has entries that"),
    "too large": (
        with_array("policy.bias_1", lambda array: array.astype(float) + 1e300),
        "'policy.bias_1' has entries that are not finite",
    ),
    "texts": (
        with_array("unit", lambda array: array.astype(str)),
        "'unit' is <U32 of shape (28,); it must be float64",
    ),
    "complex": (with_array("deviation", lambda array: 1j * array), "'deviation' is complex128"),
    "half ticks": (with_array("ahead", lambda array: 0.5 * array), "'ahead' is float64"),
    "one number": (with_array("policy.bias_1", lambda _: 0.5), "'policy.bias_1' is float64 of "),
    "a wide bias": (
        with_array("policy.bias_2", lambda array: np.tile(array[:, np.newaxis], 2)),
        "'policy.bias_2' is float32 of shape (7, 2); it must be float32, its dimensions 1",
    ),
    "another width": (
        with_array("policy.weights_2", lambda array: array[:-1]),
        "'policy.weights_1' and those after it do not fit each other",
    ),
    "too few inputs": (
        with_array("policy.weights_1", lambda array: array[:-1]),
        "does not fit 'humanoid' (its 'policy')",
    ),
    "two values": (
        lambda content: content.update(
            {
                "value.weights_3": np.zeros((7, 2), np.float32),
                "value.bias_3": np.zeros(2, np.float32),
            }
        ),
        "does not fit 'humanoid' (its 'value')",
    ),
    "too few units": (with_array("unit", lambda array: array[1:]), "(its 'unit')"),
    "too few scales": (with_array("deviation", lambda array: array[1:]), "(its 'deviation')"),
    "a mean too few": (with_array("frame_mean", lambda array: array[1:]), "(its 'frame_mean')"),
    "zero scales": (with_array("deviation", poked(0.0)), "'frame_scale' must be above 0"),
    "negative scales": (with_array("frame_scale", poked(-1.0)), "'frame_scale' must be above 0"),
    "the future alone": (with_array("ahead", lambda array: 1 + array), "'ahead' must rise from 0"),
    "back": (with_array("ahead", lambda array: array[[0, 2, 1]]), "'ahead' must rise from 0"),
    "no frame": (with_array("ahead", lambda array: array[:0]), "'ahead' must rise from 0"),
    "frames of frames": (with_array("ahead", lambda array: array[np.newaxis]), "'ahead' is int64"),
}


def error_of(path: Path | str, **given: object) -> str:
    """The one line that a controller's values are refused with, by all that looks at a policy."""
    values = resolve_for(HUMANOID, {"planner": "policy", "policy": str(path), **given})
    errors = set()
    for use in (check_planning, make_planner):
        with pytest.raises(ActuatedCharactersError) as caught:
            use(HUMANOID, values, [])
        assert type(caught.value) is ConfigurationError
        errors.add(str(caught.value))
    (error,) = errors
    assert "\n" not in error
    return error


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_in_a_file_is_one_line_that_names_it(
    case: str, whole: Path, tmp_path: Path
) -> None:
    change, reason = WRONG[case]
    with np.load(whole) as archive:
        content = {name: archive[name] for name in archive.files}
    change(content)
    path = tmp_path / "wrong.npz"
    np.savez(path, **content)

    error = error_of(path)

    assert error.startswith(str(path))
    assert reason in error


def test_an_archive_that_is_far_too_large_is_not_unpacked(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "large.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("about.npy", bytes(200_000_000))
    monkeypatch.setattr(np, "load", pytest.fail)

    assert "it has an array of 200,000,000 bytes; 80,000,000 is the most" in error_of(path)


OTHER_FILES: Mapping[str, Callable[[bytes], bytes]] = {
    "empty": lambda whole: b"",
    "a text": lambda whole: b"policy: walk\n",
    "half of one": lambda whole: whole[: len(whole) // 2],
    "an array": lambda whole: b"\x93NUMPY" + bytes(100),
    "a pickle": lambda whole: b"\x80\x04N.",
}


@pytest.mark.parametrize("case", OTHER_FILES)
def test_another_file_is_no_policy(case: str, whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "other.npz"
    path.write_bytes(OTHER_FILES[case](whole.read_bytes()))

    assert error_of(path) == (
        f"{path} is no policy's file of `train`: it is no archive of numpy (.npz)"
    )


@pytest.mark.parametrize("place", [0.1, 0.5, 0.9])
def test_a_damaged_file_is_no_policy(place: float, whole: Path, tmp_path: Path) -> None:
    content, path = bytearray(whole.read_bytes()), tmp_path / "damaged.npz"
    start = int(place * len(content))
    content[start : start + 64] = bytes(each ^ 255 for each in content[start : start + 64])
    path.write_bytes(content)

    assert error_of(path).startswith(f"{path} is no policy's file of `train`: ")


@pytest.mark.parametrize("name", ["", "nowhere.npz", "~nobody-at-all/walk.npz", 300 * "x", "."])
def test_what_is_no_file_is_one_line_that_says_what_would_be(name: str) -> None:
    assert error_of(name).startswith(
        f"parameter 'policy' is '{name}'; it must be the path of a file of `train`, or one of those"
    )


def test_a_file_that_may_not_be_read_is_one_line(
    whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*given: object, **named: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(np, "load", refuse)
    assert "Permission denied" in error_of(whole)


def test_another_characters_policy_is_one_line_that_names_both(tmp_path: Path) -> None:
    path = write_random_policy(tmp_path / "laikago.npz", LAIKAGO)
    assert read_policy(str(path), LAIKAGO).about["character"] == "laikago"

    error = error_of(path)

    assert error == (
        f"{path} is a policy of the character 'laikago', and does not fit 'humanoid' (its 'dofs')"
    )


def test_another_rate_is_one_line(whole: Path) -> None:
    error = error_of(whole, rate=120)

    assert error == f"parameter 'rate' is 120; the policy '{whole}' is for 240"
