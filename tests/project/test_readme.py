"""The README and the pages say what the code does: topics, commands, a controller in 40 lines."""

import math
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from actuated_characters.bags.reader import read_messages
from actuated_characters.cli import _parser
from controller_node.control_laws import LAWS
from controller_node.references.factory import REFERENCES
from tests.support import parameter_page, topic_table

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = [
    *(ROOT / "README.md", ROOT / "CONTRIBUTING.md"),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs/coming_from").glob("*.md")),
]
ROOMS = (
    "msgs_config|sim_node|controller_node|character_motion|actuated_characters|lecture|tests|"
    "benchmarks|examples|config"
)


@pytest.mark.slow
def test_every_command_line_of_a_page_is_one_that_the_parser_takes():
    lines = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8").replace("\\\n", " ")  # a line that goes on
        lines += re.findall(
            r"^ *\.venv/bin/actuated_characters ([^#\n]*)", text, flags=re.MULTILINE
        )
    assert len(lines) >= 30
    for line in lines:
        line = line.replace("study NAME", "study lift")
        assert _parser().parse_args(shlex.split(line)).command, line


def test_every_make_target_of_the_readme_exists():
    targets = set(re.findall(r"^make (\w+)", README, flags=re.MULTILINE))
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert targets >= {"demo", "backflip"}
    for target in targets:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


@pytest.mark.slow
def test_the_controller_of_the_readme_holds_the_pendulum_at_its_target(tmp_path, processes):
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    (code,) = [block for block in blocks if "class Swing" in block]
    assert len(code.splitlines()) <= 40
    (tmp_path / "swing.py").write_text(code, encoding="utf-8")

    processes.python("swing.py")
    recorder = processes.node("recorder", directory=str(tmp_path / "recording"))
    simulator = processes.simulator(max_ticks=1200, wait_for_subscribers=2)
    assert simulator.wait() == 0
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0

    messages = read_messages(tmp_path / "recording" / "bag", ["/joint_states"])
    last = [message.decode() for message in messages][-1]
    # where PD with gravity, m g l / 2 sin(angle) = kp (target - angle), comes to rest
    angle = last.position[0]
    assert last.velocity[0] == pytest.approx(0.0, abs=1e-6)
    assert 50.0 * (1.0 - angle) == pytest.approx(9.81 * 0.5 * math.sin(angle), rel=1e-6)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_a_page_links_to_and_names_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)", text) if "://" not in link]
    files = re.findall(rf"`((?:{ROOMS})/[\w/.]+)`", text)

    assert [link for link in links if not (page.parent / link).exists()] == []
    assert [file for file in files if not (ROOT / file).exists()] == []


def test_the_page_of_parameters_is_that_of_their_declarations() -> None:
    page = parameter_page.PAGE.read_text(encoding="utf-8")
    assert page == parameter_page.content(), "make pages renews it"


@pytest.mark.parametrize(
    ("page", "names"),
    [("controllers.md", LAWS.names), ("characters.md", REFERENCES.names)],
    ids=["laws", "references"],
)
def test_every_law_and_reference_has_a_row_in_its_table(page: str, names: tuple[str, ...]) -> None:
    rows = re.findall(
        r"^\| (`.*?) \|", (ROOT / "docs" / page).read_text("utf-8"), flags=re.MULTILINE
    )
    missing = [name for name in names if not any(f"`{name}`" in row for row in rows)]

    assert missing == [], f"docs/{page} needs a row of each in its table"


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """A link to a page, a heading or a file that is not there is a warning."""
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", tmp_path]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)

    assert built.stderr == ""
    assert built.returncode == 0
    assert "compute_effort" in (tmp_path / "api.html").read_text(encoding="utf-8")


def test_the_table_of_topics_is_that_of_their_records():
    assert topic_table.PAGE.read_text("utf-8") == topic_table.content(), "make pages renews it"
