"""A student's mistakes are one line each, with the line's number, and cost what depends on them."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from lecture.labs.student import Student, StudentError
from msgs_config.errors import ConfigurationError
from tests.lecture.labs.grading import grade, solution

COMMAND = [sys.executable, "-m", "actuated_characters.cli", "grade"]

BROKEN = """
import numpy as np
import time


def raises(x):
    return 1.0 / (x - x)


def endless(x):
    while True:
        x = x + 1.0


def stubborn(x):
    while True:
        try:
            x = x + 1.0
        except Exception:
            pass


def nothing(x):
    pass


def wrong_shape(x):
    return np.zeros(3)


def not_a_number(x):
    return x * float("nan")


def text(x):
    return "three"


def too_few():
    return 1.0


def leaves(x):
    raise SystemExit(3)


def chatters(x):
    print("hello", x)
    return x


def third(x):
    return x / 3.0
"""


@pytest.fixture
def student(tmp_path: Path) -> Iterator[Student]:
    file = tmp_path / "my.py"
    file.write_text(BROKEN)
    with Student(file) as made:
        yield made


@pytest.mark.parametrize(
    ("function", "line", "said"),
    [
        ("raises", 7, "raises() raised ZeroDivisionError: float division by zero"),
        ("nothing", 23, "nothing() returned nothing, not one number"),
        ("wrong_shape", 27, "wrong_shape() returned an array of shape (3,), not one number"),
        ("not_a_number", 31, "not_a_number() returned nan; numbers must be finite"),
        ("text", 35, "text() returned str, not one number"),
        ("too_few", 39, "too_few() takes 0 positional arguments but 1 was given"),
        ("leaves", 44, "leaves() raised SystemExit: 3"),
    ],
)
def test_a_mistake_is_a_line(student: Student, function: str, line: int, said: str) -> None:
    with pytest.raises(StudentError) as error:
        student.call(function, 2.0)

    place, _, words = str(error.value).partition(": ")
    assert place.endswith(f"my.py:{line}")
    assert words.endswith(said)
    assert student.number("chatters", 2.0) == 2.0  # the process goes on


@pytest.mark.slow
@pytest.mark.parametrize(("function", "lines"), [("endless", (11, 12)), ("stubborn", (16, 17, 18))])
def test_an_endless_loop_is_ended_where_it_is(
    student: Student, function: str, lines: tuple[int, ...]
) -> None:
    for _ in range(2):  # the second time it is not even tried
        with pytest.raises(StudentError, match="takes longer than 2 s; it was ended here") as error:
            student.call(function, 2.0)
        assert int(str(error.value).split(":")[1]) in lines
    assert student.number("chatters", 2.0) == 2.0


def test_a_function_that_is_not_there_is_named(student: Student) -> None:
    with pytest.raises(StudentError, match=r"my\.py: has no function force\(\)"):
        student.call("force", 2.0)


def test_answers_lose_their_last_bits(student: Student) -> None:
    assert student.number("third", 1.0, grid=2.0**-4) == 5.0 / 16.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def force(x):\n    return x +\n", r"my\.py:2: SyntaxError: invalid syntax"),
        ("import nowhere\n", r"my\.py:1: the file raised ModuleNotFoundError: .*'nowhere'"),
        ("x = 1\nwhile True:\n    x += 1\n", r"my\.py:[23]: the file takes longer than 2 s"),
        ("import os\nos._exit(3)\n", r"my\.py:1: the file ended its process: exit code 3"),
        (
            "import os\nos.write(3, b'abcdefghijklmnop')\n",
            r"my\.py:1: the file meddled with the grader's pipe",
        ),
    ],
)
def test_a_file_that_cannot_be_loaded_says_why_at_each_call(
    tmp_path: Path, text: str, said: str
) -> None:
    file = tmp_path / "my.py"
    file.write_text(text)
    with Student(file) as made:
        for _ in range(2):
            with pytest.raises(StudentError, match=said):
                made.call("force", 1.0)


@pytest.mark.slow
def test_only_what_depends_on_a_mistake_is_lost(tmp_path: Path) -> None:
    file = tmp_path / "my.py"
    file.write_text(solution("lab1", ("+ integral_gain * integral", "+ integral / 0.0")))

    sheet = grade("lab1", file)

    assert sheet.points == 80
    assert len(sheet.errors) == 1 and "ZeroDivisionError" in sheet.errors[0]


@pytest.mark.slow
def test_the_last_bits_of_a_processor_do_not_reach_the_states(tmp_path: Path) -> None:
    file, other = tmp_path / "my.py", tmp_path / "other.py"
    file.write_text(solution("lab2"))
    changed = ("return known", "return (1.0 + 2e-16) * known")
    other.write_text(solution("lab2", changed))

    assert grade("lab2", file).state_hash == grade("lab2", other).state_hash


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"no such file; --stub .* makes one"):
        Student(tmp_path / "my.py")


def run(*arguments: str, where: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *arguments], cwd=where, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_the_command_writes_a_stub_and_grades_it(tmp_path: Path) -> None:
    project = Path(__file__).parents[3]
    file = tmp_path / "my.py"

    written = run("lab1", "--stub", str(file), where=project)
    again = run("lab1", "--stub", str(file), where=project)
    nothing = run("lab1", where=project)
    graded = run("lab1", str(file), "--json", where=project)

    assert written.returncode == 0 and file.is_file()
    assert (again.returncode, again.stderr) == (
        1,
        f"error: {file} exists; --stub writes a new file\n",
    )
    assert nothing.returncode == 1 and "which file?" in nothing.stderr
    found = json.loads(graded.stdout)
    assert graded.returncode == 0
    assert (found["lab"], found["points"], found["of"]) == ("lab1", 0, 100)
    assert np.sum([each["of"] for each in found["criteria"]]) == 100
