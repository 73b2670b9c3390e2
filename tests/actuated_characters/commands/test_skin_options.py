"""`--skin` of commands that show characters: what cannot be is one line, before all the work."""

from pathlib import Path

import pytest

from actuated_characters.cli import main
from tests.support.bags import Made, make_run, write_bag
from tests.support.skins import skinned_glb


@pytest.fixture(scope="module")
def walk() -> Made:
    return make_run("humanoid", 0.05)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("render", "bag", "--skin", "no.glb"), "cannot read no.glb"),
        (("render", "bag", "--skin", "body.glb", "--shapes"), "one of the two"),
        (("render", "bag", "--skin-map", "joints.yaml"), "--skin-map is of a --skin"),
        (("render", "bag", "--video", "--skin", "joints.yaml"), "is a YAML file"),
        (("view", "bag", "--skin", "no.glb"), "cannot read no.glb"),
        (("view", "bag", "--skin", "body.glb", "--skin-map", "no.yaml"), "no.yaml"),
        (("view", "--skin", "no.glb"), "cannot read no.glb"),
        (("play", "--skin", "no.glb"), "cannot read no.glb"),
        (("play", "--no-view", "--skin", "body.glb"), "are of a browser"),
        (("play", "--no-view", "--skin-map", "joints.yaml"), "are of a browser"),
        (("run", "--view", "--skin", "no.glb"), "cannot read no.glb"),
        (("run", "--clip", "walk", "--skin", "body.glb"), "are of --view"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_what_cannot_be_is_one_line(
    arguments: tuple[str, ...],
    part: str,
    walk: Made,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    write_bag(tmp_path / "bag", walk.messages())
    (tmp_path / "body.glb").write_bytes(skinned_glb())
    (tmp_path / "joints.yaml").write_text("left_wrist:\n")
    before = set(tmp_path.rglob("*"))

    assert main([*arguments]) == 1

    line = capsys.readouterr().err
    assert line.startswith("error: ") and line.count("\n") == 1 and part in line, line
    assert set(tmp_path.rglob("*")) == before


def test_a_strip_shows_another_body(walk: Made, tmp_path: Path) -> None:
    bag, body = write_bag(tmp_path / "bag", walk.messages()), tmp_path / "body.glb"
    body.write_bytes(skinned_glb(scale=100.0))
    one, other = tmp_path / "one.png", tmp_path / "other.png"
    small = ("--count", "1", "--size", "80x100")

    assert main(["render", str(bag), "--output", str(one), *small]) == 0
    assert main(["render", str(bag), "--output", str(other), *small, "--skin", str(body)]) == 0

    assert one.read_bytes() != other.read_bytes()
