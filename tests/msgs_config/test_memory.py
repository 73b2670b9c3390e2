"""The memory of an object goes on in an equal one; what another user wrote is not opened."""

import os
import pickle
import stat
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from msgs_config import memory as module
from msgs_config.errors import MessageError, RecordingError
from msgs_config.memory import MemoryFormat, is_own
from msgs_config.messages import typed
from msgs_config.messages.keyframe import (
    TYPE_NAME,
    Keyframe,
    decode_keyframe,
    encode_keyframe,
    read_keyframe,
)
from msgs_config.messages.session import make_session
from msgs_config.messages.state import StampedState
from tests.support.physics import character


class Hostile:
    """Is unpickled by a call."""

    def __reduce__(self) -> tuple[object, ...]:
        return os.mkdir, ("it-was-opened",)


def sealed(raw: bytes) -> bytes:
    """Bytes as this user's programs write them."""
    packed = zlib.compress(raw)
    return module._seal_of(packed) + packed


def test_parts_are_those_of_the_reader_and_all_else_is_the_writers() -> None:
    theirs, ours = character("pendulum"), character("pendulum")
    state = StampedState(5, np.array([0.1]), np.array([-0.0]), None)
    memory = MemoryFormat(theirs).write(
        {"of": theirs, "state": state, "same": state, "limits": theirs.effort_limits}
    )
    found = MemoryFormat(ours).read(memory)
    assert found["of"] is ours
    assert found["limits"].__self__ is ours
    assert found["state"] is found["same"]
    assert found["state"].velocity.tobytes() == state.velocity.tobytes()
    assert len(memory) < 1000 < len(pickle.dumps(theirs))


def test_what_was_computed_meanwhile_makes_no_other_parts() -> None:
    used = character("humanoid")
    memory = MemoryFormat(used).write(used)
    computed = [name for name in dir(type(used.layout)) if not name.startswith("_")]
    assert any(getattr(used.layout, name) is not None for name in computed)
    assert MemoryFormat(used).read(memory) is used
    assert MemoryFormat(character("humanoid")).write("anything") == MemoryFormat(used).write(
        "anything"
    )


def test_a_memory_of_other_parts_is_refused() -> None:
    memory = MemoryFormat(character("pendulum")).write("anything")
    with pytest.raises(RecordingError, match="other parameters or files"):
        MemoryFormat(character("humanoid")).read(memory)


@pytest.mark.parametrize(
    "change",
    [
        lambda memory: memory[:-1],
        lambda memory: memory[:40] + bytes([memory[40] ^ 1]) + memory[41:],
        lambda memory: bytes(32) + memory[32:],
        lambda memory: zlib.compress(pickle.dumps((0, Hostile()))),
        lambda memory: bytes(32) + zlib.compress(pickle.dumps((0, Hostile()))),
        lambda memory: b"",
    ],
)
def test_what_is_not_sealed_is_not_opened(
    change: Callable[[bytes], bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    foreign = change(MemoryFormat().write("anything"))
    assert not is_own(foreign)
    with pytest.raises(RecordingError, match="another user or machine is not opened"):
        MemoryFormat().read(foreign)
    assert not (tmp_path / "it-was-opened").exists()


def test_the_key_is_this_users_alone_and_the_same_for_all_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make = module._key.__wrapped__
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    key = make()
    (file,) = (each for each in tmp_path.rglob("*") if each.is_file())
    assert make() == key == file.read_bytes()
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_where_it_cannot_be_kept_the_key_is_the_processs_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    first, second = module._key.__wrapped__(), module._key.__wrapped__()
    assert len(first) == len(second) == 32
    assert first != second


@pytest.mark.parametrize("raw", [b"", b"\x80", pickle.dumps(5)])
def test_what_another_version_wrote_is_an_error_of_one_line(raw: bytes) -> None:
    with pytest.raises(RecordingError, match="a keyframe cannot be read"):
        MemoryFormat(character("pendulum")).read(sealed(raw))


def test_a_message_keeps_stamp_session_and_memory(tmp_path: Path) -> None:
    keyframe = Keyframe(1_004_166_666, make_session("/sim_node"), b"\0\1memory")
    raw = encode_keyframe(keyframe)
    assert decode_keyframe(raw) == keyframe
    (tmp_path / "file").write_bytes(raw)
    assert read_keyframe(str(tmp_path / "file")) == keyframe


def test_a_picture_is_no_keyframe(tmp_path: Path) -> None:
    picture = typed.stamped(TYPE_NAME, 1, format="jpeg")
    with pytest.raises(MessageError, match="a picture of format 'jpeg', no keyframe"):
        decode_keyframe(typed.encode(picture))
    with pytest.raises(RecordingError, match="cannot be read: No such file"):
        read_keyframe(str(tmp_path / "none"))


def test_a_key_that_was_cut_short_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With an empty key anybody could seal."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    folder = tmp_path / "actuated_characters"
    folder.mkdir()
    (folder / "keyframes.key").touch()
    assert len(module._key.__wrapped__()) == 32
    assert [each.name for each in folder.iterdir()] == ["keyframes.key"]


def test_a_user_without_a_home_has_a_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/proc/none")
    assert len(module._key.__wrapped__()) == 32
