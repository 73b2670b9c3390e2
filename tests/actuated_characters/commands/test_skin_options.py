"""`--skin` of commands that show characters: what cannot be is one line, before all the work."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from actuated_characters.bags.recording import read_recording
from actuated_characters.cli import main
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.movie import GhostPlace, Movie, MovieSettings
from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.render.stills import strip
from msgs_config.arrays import BoolArray
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


def mesh_pixels(picture: Picture) -> tuple[BoolArray, BoolArray]:
    """Which pixels (h, w) have the colours of the mesh's upper and lower part."""
    red, _, blue = np.moveaxis(picture[..., :3].astype(int), 2, 0)
    return red > 2 * blue, blue > 2 * red


def test_a_strip_shows_another_body(walk: Made, tmp_path: Path) -> None:
    """The mesh is the character's own skin in other colours: it is where that was, and alone."""
    bag, body = write_bag(tmp_path / "bag", walk.messages()), tmp_path / "body.glb"
    body.write_bytes(skinned_glb(scale=100.0))
    one, other = tmp_path / "one.png", tmp_path / "other.png"
    small = ("--count", "1", "--size", "160x200")

    assert main(["render", str(bag), "--output", str(one), *small]) == 0
    assert main(["render", str(bag), "--output", str(other), *small, "--skin", str(body)]) == 0

    own, shown = (np.round(255.0 * imread(path)) for path in (one, other))
    upper, lower = mesh_pixels(shown)
    assert upper.sum() > 300 and lower.sum() > 300
    assert np.flatnonzero(upper.any(axis=1)).mean() < np.flatnonzero(lower.any(axis=1)).mean()
    changed = np.abs(own - shown)[..., :3].max(axis=2) > 40
    either, both = changed | upper | lower, changed & (upper | lower)
    assert both.sum() > 0.9 * either.sum()
    assert not (mesh_pixels(own)[0] | mesh_pixels(own)[1]).any()


def test_all_of_a_deeper_body_is_in_the_picture(walk: Made, tmp_path: Path) -> None:
    path = tmp_path / "body.glb"
    path.write_bytes(skinned_glb(scale=np.array((1.0, 1.0, 4.0))))
    recording, skin = (
        read_recording(write_bag(tmp_path / "bag", walk.messages())),
        GivenSkin.read(path),
    )
    settings = MovieSettings(size=(40, 100), skin=skin, workers=1, ghost=GhostPlace.NONE)

    pictures = [
        strip(recording, 1, size=(40, 100), labels=False, skin=skin),
        next(Movie([recording], settings).pictures()),
    ]

    for picture in pictures:
        upper, lower = mesh_pixels(picture)
        shown = upper | lower
        assert upper.sum() > 100 and lower.sum() > 100
        assert not (shown[0] | shown[-1]).any() and not (shown[:, 0] | shown[:, -1]).any()
        rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
        filled = np.ptp(rows) / len(shown), np.ptp(columns) / shown.shape[1]
        assert max(filled) > 0.6  # It is no smaller than it must be.
