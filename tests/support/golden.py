"""The golden runs: the states of each are the same, to the last bit, on every x86-64 with FMA.

`data/state_hashes.json` has their arguments, what each of the world's engines makes of them, and
the versions that it holds for. A change that is meant to alter states renews the file, in a commit
of its own that says why:

    make hashes
"""

import argparse
import json
import os
import platform
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from actuated_characters.commands.common.planned_run import planned_run
from actuated_characters.commands.run import add_run
from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.runs.in_process import run_in_process
from sim_node.physics.engine import INSTALLED_ENGINES

FILE = Path(__file__).parents[1] / "data" / "state_hashes.json"
ENGINES = ("pybullet", "mujoco-core")
_KEPT = ("state_hash", "ticks", "joint_error_mean_rad", "root_error_mean_m", "fell")
_THREADS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def processor_flags() -> set[str]:
    """The processor's flags, as Linux names them."""
    lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    return set(next((line for line in lines if line.startswith("flags")), "").split()[2:])


HOLD_HERE = platform.machine() == "x86_64" and "fma" in processor_flags()
WHY_NOT = (
    "the golden hashes hold for x86-64 with FMA: without it the C library's elementary functions "
    "have other last bits"
)


def golden() -> dict[str, Any]:
    """What the file says: `made_with`, and `runs` by name: their arguments, and each engine's."""
    content: dict[str, Any] = json.loads(FILE.read_text("utf-8"))
    return content


def engines() -> dict[str, str]:
    """Versions of what the states are worked out by, as they are installed."""
    installed = [name for name in ENGINES if find_spec(name.removesuffix("-core"))]
    return {name: version(name) for name in installed}


def made_with() -> dict[str, str]:
    """What a table is made with: the engines that it holds for, and what must not matter."""
    return {
        **engines(),
        "numpy": version("numpy"),
        "python": platform.python_version(),
        "libc": " ".join(platform.libc_ver()),
        "flags": " ".join(sorted({"avx2", "avx512f", "fma"} & processor_flags())),
    }


def arguments_of(name: str, engine: str) -> str:
    """The arguments of a run in a world of an engine."""
    return f"{golden()['runs'][name]['arguments']} --set sim_node.engine:={engine}"


def summary_here(arguments: str, folder: Path) -> dict[str, Any]:
    """The summary of `actuated_characters run ARGUMENTS`, without pictures, by this process."""
    options = _options(arguments)
    assert options.in_process
    run = planned_run(options)
    prepare_directory(folder, overwrite=True)
    run_in_process(
        run.plan,
        folder,
        write_bag=False,
        inputs=run.inputs,
    )
    return _summary_in(folder)


def _options(arguments: str) -> argparse.Namespace:
    commands = argparse.ArgumentParser().add_subparsers()
    add_run(commands)
    return commands.choices["run"].parse_args(shlex.split(arguments))


def summary_apart(
    arguments: str,
    folder: Path,
    *,
    before: str = "",
    environment: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """`summary_here` of a process of its own; its Python runs `before` first.

    Raises:
        RuntimeError: the run failed; with what it said.
    """
    script = f"""{before}
import sys
from pathlib import Path
sys.path.insert(0, {str(Path(__file__).parents[2])!r})
from tests.support import golden
golden.summary_here(sys.argv[1], Path(sys.argv[2]))
"""
    return _summary_of(["-c", script, arguments, str(folder)], folder, environment)


def summary_over_topics(arguments: str, folder: Path) -> dict[str, Any]:
    """The summary of the command with these arguments, but by processes that speak over topics.

    Raises:
        RuntimeError: the run failed; with what it said.
    """
    given = [argument for argument in shlex.split(arguments) if argument != "--in-process"]
    command = ["-m", "actuated_characters.cli", "run", *given]
    return _summary_of([*command, "--no-record", "--output", str(folder)], folder)


def _summary_of(
    arguments: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """The summary that `python ARGUMENTS` leaves in a folder."""
    done = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, **_THREADS, **(environment or {})},
        cwd=FILE.parents[2],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{arguments}: exit code {done.returncode}\n{done.stderr}")
    return _summary_in(folder)


def _summary_in(folder: Path) -> dict[str, Any]:
    summary: dict[str, Any] = json.loads((folder / "summary.json").read_text("utf-8"))
    return summary


def renew(names: Sequence[str]) -> None:
    """Run the runs named, or all, and write the file; prints what is new.

    What an engine makes of them that is not installed stays.
    """
    content = golden()
    runs, chosen = content["runs"], list(names) or list(content["runs"])
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as workers:
        made = [
            (name, engine)
            for name in chosen
            for engine in INSTALLED_ENGINES
            if engine in runs[name]
        ]
        summaries = workers.map(
            lambda run: summary_apart(arguments_of(*run), Path(folder) / "-".join(run)), made
        )
        for (name, engine), summary in zip(made, summaries, strict=True):
            old = runs[name].get(engine, {})
            runs[name][engine] = {key: summary[key] for key in _KEPT}
            print(_told(f"{name}, {engine}", old, runs[name][engine]), flush=True)
    content["made_with"] |= made_with()
    FILE.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _told(name: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    if old.get("state_hash") == new["state_hash"]:
        return f"{name}: same states"
    errors = " -> ".join(str(run.get("joint_error_mean_rad")) for run in (old, new))
    return f"{name}: OTHER states, {new['state_hash'][:16]}; mean joint error {errors} rad"


if __name__ == "__main__":
    renew(sys.argv[1:])
