"""A page of sections as HTML that needs nothing beside itself. No ROS in here."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

GENERATOR = '<meta name="generator" content="actuated_characters report">'
"""What tells a page of ours from somebody else's."""

_STYLE = """
:root { color-scheme: light dark; --line: #8886; --soft: #8881; }
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem auto; padding: 0 1rem;
       max-width: 70rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.3rem; margin-top: 2.5rem; } h3 { font-size: 1.1rem; }
h2 { border-top: 2px solid var(--line); padding-top: 1rem; }
table { border-collapse: collapse; margin: .7rem 0; }
.wide { overflow-x: auto; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { border-bottom: 1px solid var(--line); padding: .15rem .7rem .15rem 0;
         text-align: right; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
th:first-child, td:first-child, table.facts td { text-align: left; }
tr:nth-child(even) td { background: var(--soft); }
img { max-width: 100%; height: auto; background: white; border-radius: 4px; }
figure { margin: .7rem 0; } figcaption { font-size: .85rem; opacity: .75; }
nav a { margin-right: 1rem; }
@media print {
  :root { color-scheme: light; }
  body { margin: 0; max-width: none; font-size: 10pt; }
  figure, tr { break-inside: avoid; } h2, h3 { break-after: avoid; } nav { display: none; }
}
"""


@dataclass(frozen=True)
class Table:
    """Rows of texts; without columns, each row is a name and what there is to say of it."""

    rows: Sequence[Sequence[str]]
    columns: Sequence[str] = ()
    caption: str = ""


@dataclass(frozen=True)
class Illustration:
    """A picture."""

    name: str  # of the file, without suffix
    png: bytes
    text: str  # what it shows, for who does not see it


@dataclass(frozen=True)
class Section:
    """A part of the page: pictures, then tables, then notes."""

    title: str
    illustrations: Sequence[Illustration] = ()
    tables: Sequence[Table] = ()
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Chapter:
    """All sections of one character, or of the whole bag."""

    title: str
    sections: Sequence[Section]


def render_page(title: str, chapters: Sequence[Chapter]) -> str:
    """The page as HTML; all texts are taken as texts, whatever is in them."""
    links = "".join(
        f'<a href="#c{number}">{escape(chapter.title)}</a>'
        for number, chapter in enumerate(chapters)
    )
    body = "".join(_chapter(number, chapter) for number, chapter in enumerate(chapters))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f"{GENERATOR}\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n<nav>{links}</nav>\n{body}</body>\n</html>\n"
    )


def _chapter(number: int, chapter: Chapter) -> str:
    inside = "".join(map(_section, chapter.sections))
    return f'<h2 id="c{number}">{escape(chapter.title)}</h2>\n{inside}'


def _section(section: Section) -> str:
    parts = [f"<section>\n<h3>{escape(section.title)}</h3>\n"]
    parts += map(_figure, section.illustrations)
    parts += map(_table, section.tables)
    parts += [f"<p>{escape(note)}</p>\n" for note in section.notes]
    return "".join([*parts, "</section>\n"])


def _figure(illustration: Illustration) -> str:
    data = base64.b64encode(illustration.png).decode("ascii")
    text = escape(illustration.text, quote=True)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text}</figcaption></figure>\n"
    )


def _table(table: Table) -> str:
    caption = f"<caption>{escape(table.caption)}</caption>" if table.caption else ""
    head = _row("th", table.columns) if table.columns else ""
    rows = "".join(_row("td", row) for row in table.rows)
    kind = "" if table.columns else ' class="facts"'
    return f'<div class="wide"><table{kind}>{caption}{head}{rows}</table></div>\n'


def _row(tag: str, cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>\n"
