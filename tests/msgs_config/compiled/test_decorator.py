"""What is compiled is compiled again when any of its sources changes."""

import subprocess
import sys
from pathlib import Path

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
