"""A page of sections as HTML that needs no other file. Knows no ROS."""

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

GENERATOR = '<meta name="generator" content="actuated_characters report"'
"""Marks a page as a report's."""

NOT_KNOWN = "-"
"""A cell without a value; a column of nothing else is left out."""

_STYLE = """
:root { color-scheme: light dark; --line: #8886; --soft: #8881; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; padding: 0 1rem;
       max-width: 70rem; }
h1 { font-size: 1.7rem; margin-bottom: .3rem; } h3 { font-size: 1.15rem; margin-top: 2.2rem; }
h2 { border-top: 2px solid var(--line); padding-top: 1rem; margin-top: 2.5rem; }
h1::first-letter, h2::first-letter, h3::first-letter, caption::first-letter,
figcaption::first-letter { text-transform: uppercase; }
table { border-collapse: collapse; margin: .7rem 0; }
.wide { overflow-x: auto; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; white-space: nowrap; }
th, td { border-bottom: 1px solid var(--line); padding: .15rem .9rem .15rem 0;
         text-align: right; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
th, td:first-child, td:nth-child(2):not(:last-child) { overflow-wrap: break-word; }
th:first-child, td:first-child, td:nth-child(2):last-child { text-align: left; }
tr:nth-child(even) td { background: var(--soft); }
img, video { max-width: 100%; height: auto; background: white; border-radius: 6px; }
figure { margin: .7rem 0; } figcaption { font-size: .85rem; opacity: .75; }
.verdict { font-size: 1.2rem; margin: 1rem 0; }
.tiles { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1rem 0; }
.tiles div { background: var(--soft); border-radius: 6px; padding: .6rem 1rem; min-width: 9rem; }
.tiles b { display: block; font-size: 1.3rem; }
@media print {
  :root { color-scheme: light; }
  body { margin: 0; max-width: none; font-size: 10pt; }
  figure, tr, .tiles { break-inside: avoid; } h2, h3 { break-after: avoid; }
}
"""


@dataclass(frozen=True)
class Table:
    """Rows of texts below the names of their columns."""

    rows: Sequence[Sequence[str]]
    columns: Sequence[str]
    caption: str = ""


@dataclass(frozen=True)
class Illustration:
    """A picture."""

    name: str  # name of the file, without suffix
    png: bytes
    text: str  # the caption, which describes the picture to a reader who does not see it


@dataclass(frozen=True)
class Film:
    """A film beside the page."""

    address: str  # relative to the page
    text: str  # the caption


@dataclass(frozen=True)
class Section:
    """A part of the page: pictures, films, the verdict with its tiles, tables, and remarks."""

    title: str
    illustrations: Sequence[Illustration] = ()
    tables: Sequence[Table] = ()
    remarks: Sequence[str] = ()
    verdict: str = ""  # a sentence after the pictures
    tiles: Sequence[tuple[str, str]] = ()  # name and value of figures that belong to the verdict
    chapter: str = ""  # a heading above, where a chapter begins
    films: Sequence[Film] = ()


def render_page(title: str, sections: Sequence[Section]) -> str:
    """The page as HTML; all texts are escaped."""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8"/>\n'
        f"{GENERATOR}/>\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>{escape(title)}</h1>\n{''.join(map(_section, sections))}</body>\n</html>\n"
    )


def _section(section: Section) -> str:
    parts = [f"<h2>{escape(section.chapter)}</h2>\n"] if section.chapter else []
    if section.title:
        parts.append(f"<h3>{escape(section.title)}</h3>\n")
    parts += map(_figure, section.illustrations)
    parts += map(_film, section.films)
    if section.verdict:
        parts.append(f'<p class="verdict">{escape(section.verdict)}</p>\n')
    if section.tiles:
        tiles = [f"<div>{escape(name)}<b>{escape(text)}</b></div>" for name, text in section.tiles]
        parts.append(f'<div class="tiles">{"".join(tiles)}</div>\n')
    parts += map(_table, section.tables)
    parts += [f"<p>{escape(remark)}</p>\n" for remark in section.remarks]
    return "".join(parts)


def _figure(illustration: Illustration) -> str:
    data = base64.b64encode(illustration.png).decode("ascii")
    text = escape(illustration.text, quote=True)
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}"/>'
        f"<figcaption>{text}</figcaption></figure>\n"
    )


def _film(film: Film) -> str:
    address, text = escape(film.address, quote=True), escape(film.text)
    return (
        f'<figure><video src="{address}" controls preload="metadata"></video>'
        f"<figcaption>{text}</figcaption></figure>\n"
    )


def _table(table: Table) -> str:
    """A table of the columns that have a value."""
    known = [
        column
        for column in range(len(table.columns))
        if column == 0 or any(row[column] != NOT_KNOWN for row in table.rows)
    ]
    head = _row("th", [table.columns[column] for column in known])
    body = "".join(_row("td", [row[column] for column in known]) for row in table.rows)
    caption = f"<caption>{escape(table.caption)}</caption>" if table.caption else ""
    return f'<div class="wide"><table>{caption}{head}{body}</table></div>\n'


def _row(tag: str, cells: Sequence[str]) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>\n"
