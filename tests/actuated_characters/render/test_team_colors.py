"""A character has the colours of its team in pictures, films and exports, as in the viewer."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from actuated_characters.bags.recording import RecordedWorld, Recording
from actuated_characters.export.sources import of_recordings
from actuated_characters.render.engine.renderer import Picture
from actuated_characters.render.movie import GhostPlace, Movie, MovieSettings
from actuated_characters.render.scene import make_scene
from actuated_characters.render.skin.palette import color_number
from actuated_characters.render.stills import strip
from msgs_config.character.model import Placement
from tests.actuated_characters.render.test_movie import recorded
from tests.support.physics import character

TEAMS = ("sand_1", "sand_2", "blue_1")
SIZE = (80, 120)
FILM = MovieSettings(size=SIZE, workers=1, ghost=GhostPlace.NONE)


def standing(*names: str) -> list[Recording]:
    """Some of the characters of two teams, beside each other."""
    found = []
    for name in names:
        whole = character("humanoid").placed(Placement(y=-TEAMS.index(name)))
        still = np.tile(whole.rest_position, (3, 1))
        world = RecordedWorld(name=name, characters=TEAMS)
        found.append(replace(recorded(whole, still), name=name, world=world))
    return found


def blue(picture: Picture) -> int:
    """How many pixels have the second team's colours, in light or shadow."""
    red, _, blue = np.moveaxis(picture.astype(float), -1, 0)
    return int((blue - red > 0.4 * blue).sum())


def film(recordings: Sequence[Recording]) -> Picture:
    return next(iter(Movie(recordings, FILM).pictures()))


def still(recordings: Sequence[Recording]) -> Picture:
    return strip(recordings, [0.0], size=SIZE)


@pytest.mark.slow
def test_pictures_and_films_show_teams_as_the_viewer_does() -> None:
    for taken in (film, still):
        assert blue(taken(standing("sand_1", "sand_2"))) == 0
        assert blue(taken(standing("blue_1"))) > 200
        assert blue(taken(standing(*TEAMS))) > 100


def test_all_that_shows_a_recording_numbers_its_colours_alike() -> None:
    recordings = standing("blue_1", "sand_2")

    assert [color_number(each.world, 7) for each in recordings] == [1, 0]
    assert make_scene(recordings).color_numbers == (1, 0)
    assert [each.color_number for each in of_recordings(recordings).characters] == [1, 0]


def test_characters_that_are_alone_in_their_worlds_have_colours_of_their_own() -> None:
    assert color_number(RecordedWorld(), 3) == 3
