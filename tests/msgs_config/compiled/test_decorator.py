"""What is compiled is compiled again when any of its sources changes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from msgs_config.compiled import decorator
from msgs_config.compiled.decorator import choose_cache_directory

PROGRAM = """
import sys
sys.path.insert(0, {folder!r})
from pathlib import Path
from msgs_config.compiled.decorator import choose_cache_directory, compiled
compiled.cache = choose_cache_directory(Path({folder!r}).glob("*.py"), {cache!r})
import outer
print(outer.outer(1.0))
"""
INNER = "from msgs_config.compiled.decorator import compiled\n@compiled\n"
OUTER = INNER + "def outer(x):\n    return inner(x)\n"


def test_each_content_of_the_sources_has_its_directory(tmp_path: Path) -> None:
    first, second = tmp_path / "a.py", tmp_path / "b.py"
    first.write_text("1")
    second.write_text("2")
    before = choose_cache_directory([first, second], str(tmp_path))
    assert before == choose_cache_directory([second, first], str(tmp_path))
    second.write_text("3")
    after = choose_cache_directory([first, second], str(tmp_path))
    assert before.parent == after.parent == tmp_path
    assert before != after


def test_a_change_in_a_callee_of_another_file_counts(tmp_path: Path) -> None:
    """numba alone would answer with the old callee's code."""
    folder, cache = tmp_path / "sources", tmp_path / "cache"
    folder.mkdir()
    (folder / "outer.py").write_text("from inner import inner\n" + OUTER)
    printed = []
    for factor in (2, 3):
        (folder / "inner.py").write_text(INNER + f"def inner(x):\n    return {factor} * x\n")
        program = PROGRAM.format(folder=str(folder), cache=str(cache))
        run = [sys.executable, "-B", "-c", program]
        printed.append(subprocess.run(run, capture_output=True, text=True, check=True).stdout)

    assert printed == ["2.0\n", "3.0\n"]


@pytest.mark.slow
def test_a_line_says_when_something_is_compiled_and_none_when_it_is_kept(tmp_path: Path) -> None:
    (tmp_path / "one.py").write_text(
        "from pathlib import Path\n"
        "from msgs_config.compiled.decorator import Compiler\n"
        "compiled = Compiler(Path(__file__))\n"
        "@compiled\ndef twice(x):\n    return 2.0 * x\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1"}
    said = []
    for argument in ("1.0", "1.0", "1"):
        program = (
            f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import one; one.twice({argument})"
        )
        run = [sys.executable, "-c", program]
        done = subprocess.run(run, capture_output=True, text=True, check=True, env=environment)
        said.append(done.stderr.count("compiling what is computed often, once"))

    assert said == [1, 0, 1]


def test_what_is_kept_where_nothing_can_be_written_is_copied(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, given, users = (tmp_path / name for name in ("a.py", "given", "users"))
    source.write_text("1")
    kept = choose_cache_directory([source], str(given))
    kept.mkdir(parents=True)
    (kept / "code").write_text("code")
    monkeypatch.setenv("XDG_CACHE_HOME", str(users))
    monkeypatch.setattr(decorator, "_can_write", lambda directory: users in directory.parents)

    copies = [choose_cache_directory([source], str(given)) for _ in range(2)]

    assert copies == 2 * [users / "actuated_characters" / kept.name]
    assert (copies[0] / "code").read_text() == "code"
    assert list(copies[0].parent.iterdir()) == [copies[0]]


def test_what_was_not_asked_for_in_a_month_goes(tmp_path: Path) -> None:
    old, recent = (tmp_path / f"numba-{digit * 16}" for digit in "0f")
    others = tmp_path / "numba-0.60.0"  # such as numba's own sources
    for directory in (old, recent, others):
        directory.mkdir()
        (directory / "code").write_text("code")
    for directory in (old, others):
        os.utime(directory, (0.0, 0.0))

    assert decorator._make_directory(tmp_path / "numba-new")

    assert set(tmp_path.iterdir()) == {tmp_path / "numba-new", recent, others}
