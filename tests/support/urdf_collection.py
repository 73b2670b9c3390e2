"""Tries the URDF files of packages of other makers: which hold, which are refused, and why.

`make robots` gets the packages (850 MB in build/robots) and Pinocchio, and runs this module; with a
folder, such as one of cloned repositories, it tries the files in that one. Each file is tried in a
process to itself: the engine can take its process down.
"""

import argparse
import hashlib
import json
import multiprocessing
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, replace
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from xml.etree import ElementTree

import pybullet_data

from tests.support.urdf_trial import TrialResult, try_urdf

PROJECT = Path(__file__).parents[2]
DOWNLOADED = PROJECT / "build" / "robots"  # see the Makefile
FOLDERS = {  # of each package's files
    "example-robot-data": "cmeel.prefix/share/example-robot-data",
    "rtb-data": "rtbdata",
    "scikit-robot": "skrobot",
    "icub-models": "share/iCub",
    "mani-skill": "mani_skill",
}
_AGREEMENT = 1e-9
_PARTS = ("visual", "collision")


def find_urdfs(downloaded: Path) -> dict[str, list[Path]]:
    """The URDF files of each package that is there, sorted."""
    folders = {name: downloaded / folder for name, folder in FOLDERS.items()}
    folders["pybullet_data"] = Path(pybullet_data.getDataPath())
    found = {}
    for name, folder in folders.items():
        files = sorted(folder.rglob("*.urdf"))
        found[name] = [file for file in files if _is_one_of_few(file)]
    return found


def find_urdfs_of(folder: Path, most: int) -> dict[str, list[Path]]:
    """The URDF files in a folder by the folder in it, so many of each at most, each text once."""
    texts, found = set[bytes](), dict[str, list[Path]]()
    for file in sorted(folder.rglob("*")):
        if file.suffix.lower() == ".urdf" and file.is_file():
            digest = hashlib.sha256(file.read_bytes()).digest()
            if digest not in texts:
                texts.add(digest)
                found.setdefault(file.relative_to(folder).parts[0], []).append(file)
    return {name: _spread(files, most) for name, files in found.items()}


def _spread(files: list[Path], most: int) -> list[Path]:
    """So many files at most, from all over a list."""
    if len(files) <= most:
        return files
    return [files[number * len(files) // most] for number in range(most)]


def _is_one_of_few(file: Path) -> bool:
    """Of a thousand bodies of one kind, two."""
    return "random_urdfs" not in file.parts or file.stem in ("000", "500")


def try_all(files: list[Path], options: argparse.Namespace) -> Iterator[tuple[Path, TrialResult]]:
    """Try files, some at a time, each in a process to itself; in the order in which they end."""
    context = multiprocessing.get_context("fork")
    pending, running = files[::-1], dict[Connection, tuple[Path, BaseProcess, float]]()
    while pending or running:
        while pending and len(running) < options.jobs:
            file = pending.pop()
            ours, theirs = context.Pipe(duplex=False)
            process = context.Process(target=_try, args=(file, options, theirs), daemon=True)
            process.start()
            theirs.close()
            running[ours] = file, process, time.monotonic() + options.timeout
        wait(list(running), timeout=0.5)
        for connection, (file, process, end) in list(running.items()):
            result = _result(connection, process, end, options.timeout)
            if result is not None:
                del running[connection]
                connection.close()
                yield file, result


def _result(
    connection: Connection, process: BaseProcess, end: float, timeout: float
) -> TrialResult | None:
    """What a process has found; None while it is at it."""
    if not connection.poll() and process.is_alive():
        if time.monotonic() < end:
            return None
        process.kill()
        process.join()
        return TrialResult("too slow", f"not done after {timeout:g} s")
    try:
        result: TrialResult = connection.recv()
    except EOFError:
        result = TrialResult("crashed", "the process ended")
    process.join()
    return result


def _try(file: Path, options: argparse.Namespace, connection: Connection) -> None:
    with tempfile.TemporaryDirectory() as directory:
        try:
            if options.without_shapes:
                file = _without_shapes(file, Path(directory))
            result = try_urdf(file, options.duration)
        except Exception:
            result = TrialResult("traceback", "; ".join(traceback.format_exc().splitlines()[-3:]))
    connection.send(replace(result, reason=result.reason.replace(f"{directory}/", "")))


def _without_shapes(file: Path, directory: Path) -> Path:
    """A copy of a URDF whose links have no shapes; of one that is not XML a plain copy."""
    copy = directory / file.name
    try:
        tree = ElementTree.parse(file)
    except ElementTree.ParseError:
        copy.write_bytes(file.read_bytes())
        return copy
    for link in tree.getroot().iter("link"):
        for part in [part for tag in _PARTS for part in link.findall(tag)]:
            link.remove(part)
    tree.write(copy, encoding="utf-8")
    return copy


def describe(result: TrialResult) -> str:
    """A result in one line."""
    line = result.label
    if result.size or result.mass:
        line += f", {result.size} degrees of freedom, {result.mass:.4g} kg"
    if result.differences:
        name = max(result.differences, key=lambda name: result.differences[name])
        line += f", {name} differs by {result.differences[name]:.1e}"
    if result.kind == "ran":
        line += f", {result.drift:.2g} from the rest pose"
    return f"{line}: {result.reason}" if result.reason else line


def main() -> None:
    """Print the result of each file, and of each package how many there were of each kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, help="of other files")
    parser.add_argument("--most", type=int, default=1000, help="files of each folder in it")
    parser.add_argument("--downloaded", type=Path, default=DOWNLOADED)
    parser.add_argument("--match", default="", help="only files with this in their path")
    parser.add_argument("--duration", type=float, default=5.0, help="held and limp, simulated s")
    parser.add_argument("--timeout", type=float, default=300.0, help="of each trial, s")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--without-shapes", action="store_true", help="try them without meshes")
    parser.add_argument("--json", type=Path, help="write all results to this file")
    options = parser.parse_args()
    counts, agreed, results = dict[str, Counter[str]](), Counter[bool](), {}
    found = find_urdfs(options.downloaded)
    if options.folder is not None:
        found = find_urdfs_of(options.folder, options.most)
    for package, files in found.items():
        matching = [file for file in files if options.match in str(file)]
        counts[package] = Counter()
        for file, result in try_all(matching, options):
            counts[package][result.label] += 1
            if result.differences:
                agreed[max(result.differences.values()) <= _AGREEMENT] += 1
            results[str(file)] = asdict(result)
            print(f"{package}\t{file.name}\t{describe(result)}", flush=True)
    print()
    for package, count in [*counts.items(), ("all", sum(counts.values(), Counter[str]()))]:
        kinds = ", ".join(f"{number} {kind}" for kind, number in sorted(count.items()))
        print(f"{package}: {count.total()} files: {kinds}")
    print(
        f"compared with Pinocchio: {agreed[True]} agree to {_AGREEMENT:g}, {agreed[False]} do not"
    )
    if options.json:
        options.json.write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
