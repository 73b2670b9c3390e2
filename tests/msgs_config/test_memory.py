"""The memory of an object goes on in an equal one, and bytes of a stranger run nothing of his."""

import functools
import operator
import os
import pickle
import zlib
from pathlib import Path

import numpy as np
import pytest

from msgs_config.errors import MessageError, RecordingError
from msgs_config.memory import MemoryFormat, pack, unpack
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

PACKAGES = ("msgs_config.character", "msgs_config.messages")


class Calls:
    """Is pickled as a call."""

    def __init__(self, function: object, *arguments: object) -> None:
        self.call = function, arguments

    def __reduce__(self) -> tuple[object, ...]:
        return self.call


def test_parts_are_those_of_the_reader_and_all_else_is_the_writers() -> None:
    theirs, ours = character("pendulum"), character("pendulum")
    state = StampedState(5, np.array([0.1]), np.array([-0.0]), None)
    memory = MemoryFormat(PACKAGES, theirs).write({"of": theirs, "state": state, "same": state})
    found = MemoryFormat(PACKAGES, ours).read(memory)
    assert found["of"] is ours
    assert found["state"] is found["same"]
    assert found["state"].velocity.tobytes() == state.velocity.tobytes()
    assert len(memory) < 1000 < len(pickle.dumps(theirs))


def test_methods_are_written_by_their_names() -> None:
    made = character("pendulum")
    found = MemoryFormat(PACKAGES, made).read(
        MemoryFormat(PACKAGES, made).write(made.effort_limits)
    )
    assert found.__self__ is made
    assert found().tolist() == made.effort_limits().tolist()


@pytest.mark.parametrize(
    "hostile",
    [
        Calls(os.system, "true"),
        Calls(eval, "1"),
        Calls(getattr, character, "__globals__"),
        Calls(operator.attrgetter("real"), 1),
        Calls(Path, "/"),
        Calls(functools.partial(os.getcwd)),
        b"cmsgs_config.character.loading\nfiles\n.",  # a module that another one has imported
        b"\x80\x04\x8c\x1emsgs_config.character.loading\x8c\tfiles.os\x93.",
        b"",
        b"\x80",
    ],
)
def test_foreign_bytes_are_an_error_of_one_line(hostile: object) -> None:
    raw = hostile if isinstance(hostile, bytes) else pickle.dumps((0, hostile))
    with pytest.raises(RecordingError, match="a keyframe cannot be read"):
        MemoryFormat(PACKAGES).read(raw)


def test_the_name_of_a_method_reaches_methods_alone() -> None:
    made = character("pendulum")
    memory = MemoryFormat(PACKAGES, made).write(made.effort_limits)
    for name in (b"__class__", b"__reduce__", b"no_such"):
        short = memory.replace(b"\x8c\reffort_limits", b"\x8c" + bytes([len(name)]) + name)
        assert short != memory
        with pytest.raises(RecordingError, match="a keyframe cannot be read"):
            MemoryFormat(PACKAGES, made).read(short)


def test_a_memory_of_other_parts_is_refused() -> None:
    memory = MemoryFormat(PACKAGES, character("pendulum")).write("anything")
    with pytest.raises(RecordingError, match="other parameters or files"):
        MemoryFormat(PACKAGES, character("humanoid")).read(memory)


@pytest.mark.parametrize("change", [lambda raw: raw[:-3], lambda raw: b"\0" + raw, lambda _: b""])
def test_damage_is_an_error(change: functools.partial[bytes]) -> None:
    with pytest.raises(RecordingError, match="cannot be read"):
        unpack(change(pack(b"memory" * 100)))


def test_what_unpacks_to_too_much_is_refused() -> None:
    packer = zlib.compressobj()
    bomb = b"".join(packer.compress(bytes(1 << 20)) for _ in range(300)) + packer.flush()
    with pytest.raises(RecordingError, match="too large"):
        unpack(bomb)


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
