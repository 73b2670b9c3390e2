"""The films of the site's first page: of documented commands, beside their words, and small."""

from pathlib import Path

from benchmarks.gallery import GALLERY, PROGRAM
from tests.documented.collecting import collect

DOCS = Path(__file__).parents[2] / "docs"
MOST_BYTES = 3_000_000  # of all of them, which everybody who clones has


def test_each_film_is_of_a_documented_command_and_stands_beside_it() -> None:
    page, documented = (DOCS / "index.md").read_text("utf-8"), collect()

    for name, film in GALLERY.items():
        assert film.command in documented
        assert f"(pictures/gallery_{name}.webp)" in page
        assert f"`{film.command.removeprefix(f'{PROGRAM} ')}`" in page


def test_the_films_are_there_and_small() -> None:
    films = sorted((DOCS / "pictures").glob("gallery_*.webp"))

    assert {film.stem.removeprefix("gallery_") for film in films} == set(GALLERY)
    assert sum(film.stat().st_size for film in films) < MOST_BYTES
