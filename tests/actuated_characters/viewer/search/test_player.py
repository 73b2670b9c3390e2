"""What the page of a search shows: which worlds are where, in which colours, with which words."""

from collections.abc import Iterator

import numpy as np
import pytest

from actuated_characters.viewer.search.news import Fate, MotionNews, WindowNews, WorldNews
from actuated_characters.viewer.search.panel import EARLIER, LATER, NEWEST
from actuated_characters.viewer.search.player import Searched, SearchPlayer
from actuated_characters.viewer.search.stage import world_places
from actuated_characters.viewer.web.request_check import RequestCheck
from actuated_characters.viewer.web.server import open_socket, start_server, stop_server
from msgs_config.character.loading import load_character

CHARACTER, RATE = load_character("humanoid"), 240
STANDING = np.array(CHARACTER.rest_position)
WHOLE = 10.0  # s of wall time, in which any window here is seen whole
FATES = (Fate.KEPT, Fate.BEST, Fate.DROPPED, Fate.LOST)


def moving(ticks: int, metres: float = 0.1) -> np.ndarray:
    """Positions (t, n) of one that stands, and slides ahead."""
    positions = np.tile(STANDING, (ticks, 1))
    positions[:, 0] += np.linspace(0.0, metres, ticks)
    return positions


def window(number: int, fates: tuple[Fate, ...] = FATES, failures: int = 0) -> WindowNews:
    worlds = tuple(
        WorldNews(moving(25, 0.1 * k), fate, None if fate is Fate.LOST else 2.0 + 11.0 * k)
        for k, fate in enumerate(fates)
    )
    best = moving(24 * number)
    return WindowNews(number, 5, 0.1 * number, failures, worlds, 0, best, best)


FOUND = MotionNews(moving(120), moving(120), "the one that stays", "found <b>so</b>.")


@pytest.fixture(scope="module")
def player() -> Iterator[SearchPlayer]:
    server = start_server(open_socket("127.0.0.1", 0), RequestCheck("127.0.0.1"), lambda _: None)
    yield SearchPlayer(server, Searched(CHARACTER, "humanoid: kick", RATE))
    stop_server(server)


@pytest.fixture(autouse=True)
def new_search(player: SearchPlayer) -> None:
    player._all.clear()
    player._number, player._goes_on = -1, True
    player.draw(WHOLE)


def shown(player: SearchPlayer) -> dict[str, tuple[int, int, int]]:
    """The words over the heads of worlds' figures, with a colour that all their links have."""
    found = {}
    for figure in player.stage._worlds:
        if figure.is_shown:
            colors = {mesh.color for meshes in figure._meshes for mesh in meshes}
            assert len(colors) == 1
            found[figure.word] = colors.pop()
    return found


def test_each_world_has_the_word_and_the_colour_of_what_becomes_of_it(
    player: SearchPlayer,
) -> None:
    player.take(window(1))
    player.draw(0.0)

    assert shown(player) == {
        "kept 2.0": Fate.KEPT.color,
        "best 13": Fate.BEST.color,
        "dropped 24": Fate.DROPPED.color,
        "lost": Fate.LOST.color,
    }
    assert len({fate.color for fate in Fate}) == len(Fate)
    assert "**humanoid: kick**, up to 0.10 s" in player.panel.text
    assert "**Window 1 of 5**: 4 worlds, 2 kept, 1 lost. Costs 2.0 to 24." in player.panel.text
    assert "So far in no window all were lost." in player.panel.text


def test_where_all_are_lost_it_says_that_the_search_goes_back(player: SearchPlayer) -> None:
    player.take(window(2, (Fate.LOST,) * 4, failures=1))
    player.draw(0.0)

    assert "0 kept, 4 lost. **All are lost**: the search goes back" in player.panel.text
    assert "So far all were lost once." in player.panel.text


def test_worlds_begin_in_their_places_and_the_best_path_is_before_them(
    player: SearchPlayer,
) -> None:
    player.take(window(1))
    player.draw(0.0)

    worlds = np.array([each.root[:2] for each in player.stage._worlds[:4]])
    assert worlds == pytest.approx(world_places(4))
    assert player.stage._best.word == "best so far"
    towards = np.array((1.0, -1.0))  # the camera
    assert ((player.stage._best.root[:2] - worlds) @ towards > 1.0).all()


@pytest.mark.parametrize("count", [1, 2, 5, 6, 7, 12])
def test_no_two_worlds_are_in_one_place(count: int) -> None:
    places = world_places(count)
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2) + 9.0 * np.eye(count)

    assert places.shape == (count, 2)
    assert apart.min() > 0.7


def test_each_window_is_seen_whole_before_the_next_one_and_then_what_was_found(
    player: SearchPlayer,
) -> None:
    for news in (window(1), window(2), FOUND):
        player.take(news)
    seen = []
    for seconds in (0.0, 0.1, WHOLE, 0.1, WHOLE):
        player.draw(seconds)
        player.draw(0.0)
        seen.append(player.panel.text.split("**")[3])

    assert seen == ["Window 1 of 5"] * 2 + ["Window 2 of 5"] * 2 + ["the one that stays"]
    assert not shown(player)
    assert player.stage._best.word == "the one that stays"
    assert "found \\<b\\>so" in player.panel.text


def test_earlier_windows_can_be_seen_again(player: SearchPlayer) -> None:
    for news in (window(1), window(2), window(3)):
        player.take(news)

    def after(button: str) -> str:
        player.move(button)
        player.draw(WHOLE)
        player.draw(0.0)
        return player.panel.text

    assert "Window 3 of" in after(NEWEST)
    assert "Window 2 of" in (text := after(EARLIER)) and "1 later one:" in text
    assert "Window 1 of" in after(EARLIER)
    player.take(window(4))
    assert "Window 1 of" in (text := after(EARLIER)) and "3 later ones" in text
    assert "Window 2 of" in after(LATER)
    assert "Window 4 of" in after(NEWEST)


def test_who_comes_late_to_a_long_search_sees_the_newest_window(player: SearchPlayer) -> None:
    for number in range(1, 40):
        player.take(window(number))
    player.draw(0.0)

    assert "Window 39 of" in player.panel.text
