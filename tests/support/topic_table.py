"""The documented table of topics, from their records: `python -m tests.support.topic_table`."""

from pathlib import Path

from msgs_config.messages.topic import Topic
from msgs_config.messages.topics import TABLE

PAGE = Path(__file__).parents[2] / "docs" / "topics.md"
_HEAD = "| topic | type | from → to | content |\n| --- | --- | --- | --- |\n"


def table() -> str:
    return _HEAD + "".join(map(_row, TABLE))


def _row(topic: Topic) -> str:
    type_name = topic.type_name.replace("/msg/", "/")
    return f"| `{topic.name}` | {type_name} | {topic.way} | {topic.content} |\n"


def content() -> str:
    """The page with the table of now."""
    before, _, rest = PAGE.read_text("utf-8").partition(_HEAD)
    return before + table() + "\n" + rest.partition("\n\n")[2]


if __name__ == "__main__":
    PAGE.write_text(content(), "utf-8")
