"""Tries documented commands, each in a copy of the clone, as a reader of its page types it."""

import os
import re
import shutil
import signal
import subprocess
import time
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.documented.collecting import ROOT
from tests.documented.looking import Seen, broken, look_at
from tests.documented.promise import Promise

_LONGEST = 7200.0  # s
_PATIENCE = 60.0  # s that a command may take to end after Ctrl-C, or to show its page
_LEFT_OUT = {
    ".git",
    "runs",
    "studies",
    "sweeps",
    "searches",
    "trials",
    "build",
    "recording",
    "reconstructions",
}
_ADDRESS = re.compile(r"https?://[\w.\[\]:]+(?:/\S*)?")
_INTERRUPTED = (0, 130, -signal.SIGINT)


@dataclass(frozen=True)
class Outcome:
    """What was seen of a command."""

    command: str
    seen: str
    faults: tuple[str, ...]
    cpu_s: float


class Reader:
    """Tries commands one after another; what one needs of others is made once."""

    def __init__(self, folder: Path, promises: Mapping[str, Promise]) -> None:
        self._folder, self._promises = folder, promises
        self._made: dict[str, Path] = {}  # folders of commands that others need, by command

    def attempt(self, command: str) -> Outcome:
        """Try a command, and look at what it promises."""
        promise = self._promises[command]
        place = self._place(command, promise)
        if isinstance(place, str):
            return Outcome(command, "", (place,), 0.0)
        text = command
        for word, meaning in promise.words.items():
            text = text.replace(word, meaning)
        spent = _cpu()
        exit_code, said, shown = _run(text, place, promise)
        faults = []
        if exit_code not in (_INTERRUPTED if promise.ends_after else (promise.exits,)):
            faults.append(f"it ended with {exit_code}: {said.strip()[-300:]}")
        if promise.page and not shown:
            faults.append("no page was there")
        if promise.says and not re.search(promise.says, said):
            faults.append(f"it does not say '{promise.says}': {said.strip()[-200:]}")
        faults += [f"there is no {name}" for name in promise.makes if not (place / name).exists()]
        seen = look_at(place / promise.run) if promise.run else Seen()
        other = look_at(place / promise.same_as) if promise.same_as else None
        faults += broken(promise, seen, other)
        parts = [seen.describe(), "its page" if shown else "", ", ".join(promise.makes)]
        self._made[command] = place
        return Outcome(command, "; ".join(filter(None, parts)), tuple(faults), _cpu() - spent)

    def _place(self, command: str, promise: Promise) -> Path | str:
        """A folder like a clone, with what the command needs in it; or why there is none."""
        place = self._folder / f"{len(list(self._folder.iterdir())):03}"
        place.mkdir()
        for entry in ROOT.iterdir():
            if entry.name not in _LEFT_OUT:
                (place / entry.name).symlink_to(entry)
        for need in promise.given:
            if need in self._promises:
                if need not in self._made and (faults := self.attempt(need).faults):
                    return f"'{need}' failed: {faults[0]}"
                _copy(self._made[need], place)
            else:
                from tests.documented.given import make

                make(need, place)
        return place


def _copy(made: Path, place: Path) -> None:
    """Copy what a command has made, and leave the clone's own files."""
    for entry in made.iterdir():
        if not entry.is_symlink():
            if entry.is_dir():
                shutil.copytree(entry, place / entry.name, dirs_exist_ok=True)
            else:
                shutil.copy(entry, place / entry.name)


def _run(text: str, place: Path, promise: Promise) -> tuple[int, str, bool]:
    """Exit code, what was printed, and whether a page was there."""
    environment = {**os.environ, "PATH": f"{ROOT / '.venv/bin'}:{os.environ['PATH']}"}
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "AMENT_PREFIX_PATH"):
        environment.pop(name, None)
    log = place / "said.txt"
    with log.open("wb") as stream:
        process = subprocess.Popen(
            # a script ends where one of its commands fails
            ["bash", *(("-e", "-m", "-c", text) if "\n" in text else ("-c", f"exec env {text}"))],
            cwd=place,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=_take_interrupts,
        )
        try:
            shown = promise.page and _shows_a_page(log, process)
            process.wait(promise.ends_after or _LONGEST)
        except subprocess.TimeoutExpired:
            _interrupt(process)
        except BaseException:
            _interrupt(process)  # it has a session of its own, where our Ctrl-C does not come
            raise
    return process.returncode, log.read_text(encoding="utf-8", errors="replace"), shown


def _take_interrupts() -> None:
    """Let Ctrl-C end what is started, also where it is ignored here, as in a background job."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _interrupt(process: "subprocess.Popen[bytes]") -> None:
    """Press Ctrl-C, and wait; what does not end is killed, and so fails."""
    os.killpg(process.pid, signal.SIGINT)
    try:
        process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _shows_a_page(log: Path, process: "subprocess.Popen[bytes]") -> bool:
    """Whether the page at the address that is printed is there, and is one."""
    deadline = time.monotonic() + _PATIENCE
    while time.monotonic() < deadline and process.poll() is None:
        found = _ADDRESS.search(log.read_text(encoding="utf-8", errors="replace"))
        if found:
            try:
                with urllib.request.urlopen(found.group().rstrip(".,;"), timeout=5.0) as answer:
                    return bool(answer.status == 200 and b"<html" in answer.read().lower())
            except OSError:
                pass  # it is printed a moment before it listens
        time.sleep(0.2)
    return False


def _cpu() -> float:
    """Processor time of all children that have ended, s."""
    times = os.times()
    return times.children_user + times.children_system
