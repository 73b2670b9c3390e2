"""The page about a run: whole, by itself, and with the numbers that the messages give."""

import base64
import json
import re
from dataclasses import replace
from html import escape
from io import BytesIO
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.image import imread
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from actuated_characters.bags.recording import read_recording
from actuated_characters.bags.writer import BagWriter
from actuated_characters.cli import main
from actuated_characters.metrics.falls import reader_for
from actuated_characters.metrics.recording_metrics import contact_series, measure_recording
from actuated_characters.metrics.run_metrics import Measurement
from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.report.decimation import decimated, span_maxima
from actuated_characters.report.page import NOT_KNOWN, Section, Table, render_page
from actuated_characters.report.sections import NAMES
from actuated_characters.report.writing import default_directory, write_report
from msgs_config.errors import RecordingError
from msgs_config.messages import configuration, topics
from msgs_config.messages.state import StampedReference
from msgs_config.messages.topic import STREAM, Topic
from tests.support.bags import (
    Made,
    add_to,
    make_run,
    raw_configuration,
    raw_references,
    raw_states,
    write_bag,
)
from tests.support.eventful import Eventful, eventful_run, write_timed

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

HOSTILE = "<script>alert('x')</script>&amp;"
TICKS = 120
RESET_AFTER = 70
WALK: dict[str, object] = {"reference": "clip", "clip": "walk"}


class Page:
    """The elements of a page; one that is not closed is an error."""

    def __init__(self, text: str) -> None:
        self.text = text
        root = ElementTree.fromstring(text.partition("\n")[2])  # without the document's type
        every = list(root.iter())
        assert not any(each.tag == "script" for each in every)
        texts = {each: "".join(each.itertext()) for each in every}
        self.links = [each.attrib[k] for each in every for k in ("src", "href") if k in each.attrib]
        self.texts = set(texts.values())
        self.pictures = [each.attrib["src"] for each in root.iter("img")]
        self.cells = [[texts[cell] for cell in row] for row in root.iter("tr")]
        self.headings = [texts[each] for each in every if each.tag in ("h2", "h3", "p")]

    def rows(self, name: str) -> list[list[str]]:
        """The rows that begin with a name."""
        return [row for row in self.cells if row and row[0] == name]


@pytest.fixture(scope="module")
def walk() -> Eventful:
    return eventful_run(
        "humanoid",
        TICKS,
        WALK,
        pushed=[(30, 12, "chest", (300.0, 0.0, 0.0))],
        reset_after=RESET_AFTER,
        pause_after=100,
        mode="realtime",
    )


@pytest.fixture(scope="module")
def run(walk: Eventful, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run's directory, with a mode of a name that means harm in its bag, and its report."""
    directory = tmp_path_factory.mktemp("walk")
    mode = topics.MODE.of(topics.CONTROLLER_NODE)
    text = json.dumps({"stamp_ns": walk.states[5].stamp_ns, "mode": HOSTILE})
    hostile = (mode, serialize_message(String(data=text)))
    write_timed(directory / "bag", [*walk.messages(), (hostile, walk.log_times_ns[-1])])
    assert main(["report", str(directory), "--stills", "2"]) == 0
    return directory


@pytest.fixture(scope="module")
def page(run: Path) -> Page:
    return Page((run / "report" / "index.html").read_text(encoding="utf-8"))


# The page


def test_the_page_is_whole_and_needs_nothing_beside_itself(page: Page) -> None:
    assert page.links
    for link in page.links:
        assert link.startswith("data:image/png;base64,")
    style = page.text[page.text.index("<style>") : page.text.index("</style>")]
    assert "url(" not in style and "@import" not in style
    assert "prefers-color-scheme" in style or "color-scheme: light dark" in style


def test_names_from_the_bag_are_texts(page: Page) -> None:
    assert any(HOSTILE in text for text in page.texts)
    assert "<script" not in page.text


def test_the_pictures_lie_beside_the_page(run: Path, page: Page) -> None:
    names = {path.name for path in (run / "report").iterdir()} - {"index.html"}

    assert names == {f"{name}.png" for name in NAMES}
    assert len(page.pictures) == len(names)
    for name in names:
        assert imread(BytesIO((run / "report" / name).read_bytes())).std() > 0.0


def test_the_page_begins_with_picture_and_verdict_and_ends_with_what_shows_the_rest(
    run: Path, page: Page
) -> None:
    strip = base64.b64encode((run / "report" / "strip.png").read_bytes()).decode()
    verdict = f"It tracked its reference for {TICKS / 240:.4g} s without a fall"
    rest = [f"actuated_characters view {run}", f"actuated_characters info {run} --ticks"]
    parts = [strip, verdict, "mean joint error", "tracking error", "torques against limits"]
    parts += ["links in contact over time", "events", *rest]

    places = [page.text.rindex(escape(part)) for part in parts]

    assert "<h1>humanoid: walk</h1>" in page.text
    assert places == sorted(places)


def test_a_fall_is_in_the_verdict(tmp_path: Path) -> None:
    made = make_run("humanoid", 0.4, WALK)
    fallen = made.ticks[12].state.position.copy()
    fallen[2] = 0.3
    states = [replace(s, position=fallen) if n >= 12 else s for n, s in enumerate(made.states)]
    references = [tick.reference for tick in made.ticks if tick.reference is not None]
    messages = [*raw_states(made.plan, states), *raw_references(made.plan, references)]

    page = write_report(write_bag(tmp_path / "bag", [raw_configuration(made.plan), *messages]))

    text = page.read_text(encoding="utf-8")
    assert "It fell at 0.05 s of 0.4 s." in text
    assert ["0.0500", "it fell"] in Page(text).cells


def test_the_table_of_errors_is_that_of_the_messages(page: Page, walk: Eventful) -> None:
    layout = walk.plan.character.layout
    desired = {reference.stamp_ns: reference.position for reference in walk.references}
    known = [state for state in walk.states if state.stamp_ns in desired]
    for name in ("left_knee", "right_elbow"):
        entry = layout.joint(name).start
        errors = np.abs([state.position[entry] - desired[state.stamp_ns][entry] for state in known])
        expected = [errors.mean(), np.percentile(errors, 95), errors.max()]
        row = next(row for row in page.rows(name) if row[1] == "rad")
        assert row[2:] == [f"{value:.4g}" for value in expected]
    root = [np.linalg.norm(s.position[:3] - desired[s.stamp_ns][:3]) for s in known]
    row = next(row for row in page.rows("root") if row[1] == "m")
    assert row[2] == f"{np.mean(root):.4g}"


def test_the_table_of_efforts_is_that_of_the_messages(page: Page, walk: Eventful) -> None:
    layout = walk.plan.character.layout
    applied = np.array([s.effort for s in walk.states if s.effort is not None])
    assert len(applied) == TICKS - 1  # but the reset
    for name, limit in (("left_knee", 150.0), ("chest", 200.0)):
        sizes = np.linalg.norm(applied[:, layout.joint(name).entries], axis=1)
        row = next(row for row in page.rows(name) if row[1] == "N m")
        assert row[2] == f"{sizes.mean():.4g}" and row[4] == f"{sizes.max():.4g}"
        assert row[5:] == [f"{limit:g}", f"{100.0 * np.mean(sizes >= limit):.3g} %"]


def test_contacts_are_those_of_the_messages(page: Page, walk: Eventful, run: Path) -> None:
    recording = read_recording(run)

    series = contact_series(recording.character, recording.contacts)

    assert series is not None and "right_ankle" in series.links
    expected = [wrenches.wrenches[:, 2].sum() for wrenches in walk.contacts]
    np.testing.assert_array_equal(series.vertical_force, expected)
    assert set(series.links) == {link for wrenches in walk.contacts for link in wrenches.links}
    for link, touching in zip(series.links, series.touching.T, strict=True):
        assert touching.tolist() == [link in wrenches.links for wrenches in walk.contacts]
        assert [link, f"{100.0 * touching.mean():.3g} %"] in page.cells


def test_what_happened_is_listed(page: Page) -> None:
    told = [row for row in page.cells if len(row) == 2]

    assert ["0.1250", "push on chest for 0.05 s: up to 300 N, 15 N s"] in told
    last = (TICKS - RESET_AFTER - 1) / 240
    assert [f"{(RESET_AFTER + 1) / 240:.4f}", f"reset; the episode lasts {last:.4g} s"] in told


def test_the_figures_are_those_of_the_run(tmp_path: Path) -> None:
    made = make_run("humanoid", 0.1, WALK)
    recording = read_recording(write_bag(tmp_path / "bag", made.messages()))
    known = configuration.parse(configuration.describe(made.plan.character, made.plan.simulator))
    measurement = Measurement(known, reader_for(made.plan.character))
    for tick in made.ticks:
        measurement.add(tick)

    summary, series = measure_recording(recording)

    assert summary == measurement.summary(wall_time=24e-9)  # as tests/support/bags.py stamps them
    for name, column in measurement.series().items():
        np.testing.assert_array_equal(series[name], column)


# What is not there is said


def test_what_a_recording_lacks_is_said(tmp_path: Path) -> None:
    made = make_run("franka_panda", 0.05)
    messages = [raw_configuration(made.plan), *raw_states(made.plan, made.states)]
    bag = write_bag(tmp_path / "bag", messages)

    page = Page(write_report(bag, stills=0).read_text(encoding="utf-8"))

    for words in (
        "The recording has no reference.",
        "The recording has no contacts",
        "Pushes were not recorded.",
    ):
        assert any(words in heading for heading in page.headings)
    assert (tmp_path / "bag-report" / "efforts.png").is_file()
    assert "A run of 0.05 s without a reference." in page.text and "root" not in page.headings


def test_a_reference_that_is_the_state_tells_no_error(tmp_path: Path) -> None:
    made = make_run("humanoid", 0.1)
    own = [StampedReference(each.stamp_ns, each.position, each.velocity) for each in made.states]
    messages = [*raw_states(made.plan, made.states), *raw_references(made.plan, own)]
    bag = write_bag(tmp_path / "bag", [raw_configuration(made.plan), *messages])

    page = Page(write_report(bag, stills=0).read_text(encoding="utf-8"))

    assert "Its reference is where it was itself, which tells no error." in page.headings


def test_one_state_is_enough(tmp_path: Path) -> None:
    made = make_run("pendulum", 0.05)
    messages = [raw_configuration(made.plan), *raw_states(made.plan, made.states[:1])]
    bag = write_bag(tmp_path / "bag", messages)

    page = Page(write_report(bag, stills=0).read_text(encoding="utf-8"))

    assert "The recording has no efforts." in page.headings


def test_each_of_several_characters_has_its_chapter(tmp_path: Path) -> None:
    made = make_run("pendulum", 0.05)
    with BagWriter(tmp_path / "bag") as bag:
        for namespace in ("left", "right"):
            add_to(bag, made.messages(), namespace)

    written = write_report(tmp_path, tmp_path / "out", stills=1)

    page = Page(written.read_text(encoding="utf-8"))
    assert [h for h in page.headings if h in ("left", "right")] == ["left", "right"]
    names = {path.name for path in written.parent.iterdir()}
    assert {"1-left-errors.png", "2-right-errors.png", "2-right-strip.png"} <= names


# Where it goes


def test_a_report_is_replaced_and_nothing_else_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], pendulum: Made
) -> None:
    bag = write_bag(tmp_path / "bag", pendulum.messages())
    directory = default_directory(bag)
    write_report(bag, stills=0)
    (directory / "contacts.png").touch()  # of an earlier report

    write_report(bag, stills=0)
    assert not (directory / "contacts.png").exists()

    (directory / "mine.png").touch()
    write_report(bag, stills=0)
    assert (directory / "mine.png").exists()
    (directory / "index.html").write_text("<!DOCTYPE html><p>mine</p>")
    assert main(["report", str(bag)]) == 1
    output = capsys.readouterr().err
    assert "holds other files than a report's: index.html" in output and output.count("\n") == 1
    assert "mine" in (directory / "index.html").read_text()
    (directory / "index.html").unlink()
    with pytest.raises(RecordingError, match=r"than a report's: efforts\.png"):
        write_report(bag)


@pytest.mark.parametrize("after", [0, 3, 5])
def test_an_interrupted_report_leaves_the_old_one(
    tmp_path: Path, pendulum: Made, after: int
) -> None:
    bag = write_bag(tmp_path / "bag", pendulum.messages())
    page = write_report(bag, stills=0)
    before = {file.name: file.read_bytes() for file in page.parent.iterdir()}
    told: list[int] = []

    def interrupt(done: int, total: int) -> None:
        told.append(done)
        assert total == 5
        if done == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_report(bag, stills=1, progress=interrupt)

    assert told == list(range(after + 1))
    assert {file.name: file.read_bytes() for file in page.parent.iterdir()} == before


def test_a_report_is_one_of_a_runs_results(tmp_path: Path, pendulum: Made) -> None:
    write_bag(tmp_path / "bag", pendulum.messages())
    assert write_report(tmp_path, stills=0) == tmp_path / "report" / "index.html"

    prepare_directory(tmp_path, overwrite=True)

    assert not (tmp_path / "report").exists()


@pytest.fixture(scope="module")
def pendulum() -> Made:
    return make_run("pendulum", 0.05)


def test_a_bag_of_something_else_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chatter = Topic("chatter", "std_msgs/msg/String", STREAM)
    bag = write_bag(tmp_path / "bag", [(chatter, serialize_message(String(data="hello")))])

    assert main(["report", str(bag)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not default_directory(bag).exists()


# Parts


def test_texts_are_escaped_wherever_they_are() -> None:
    evil = "<img src=x onerror=alert(1)>\"'&"
    section = Section(evil, tables=[Table([(evil,)], (evil,), evil)], remarks=[evil], chapter=evil)

    page = Page(render_page(evil, [section]))

    assert page.pictures == []
    assert page.rows(evil) == [[evil], [evil]]
    assert not re.search(r"onerror=alert\(1\)>", page.text)


def test_a_column_without_a_value_is_left_out() -> None:
    table = Table([("a", NOT_KNOWN, "1"), ("b", NOT_KNOWN, NOT_KNOWN)], ("joint", "limit", "p"))

    page = Page(render_page("page", [Section("", tables=[table])]))

    assert page.cells == [["joint", "p"], ["a", "1"], ["b", NOT_KNOWN]]


def test_a_long_series_keeps_its_extremes() -> None:
    times = np.arange(100_000) / 1000.0
    values = np.random.default_rng(1).normal(size=(100_000, 2))
    values[12_345, 0], values[77_777, 1], values[500:900, 0] = 50.0, -60.0, np.nan

    at, drawn = decimated(times, values, most=500)

    assert len(at) == len(drawn) == 1000
    assert np.nanmax(drawn[:, 0]) == 50.0 and np.nanmin(drawn[:, 1]) == -60.0
    spike = int(np.nanargmax(drawn[:, 0]))
    assert at[spike] == pytest.approx(12.345, abs=0.2)
    assert np.isnan(drawn[:, 0]).sum() == 2  # one span had nothing else
    np.testing.assert_array_equal(decimated(times[:9], values[:9], most=500)[1], values[:9])


def test_spans_have_their_largest_value() -> None:
    values = np.arange(20.0).reshape(10, 2)

    assert span_maxima(values, 3)[:, 0].tolist() == [4.0, 10.0, 18.0]
    assert span_maxima(values, 50).tolist() == values.tolist()
