"""Opens the page on which a timeline is made."""

from pathlib import Path

from actuated_characters.render.skin.given import GivenSkin
from actuated_characters.timeline.document import Document
from actuated_characters.viewer.editor.page import EditorPage
from actuated_characters.viewer.editor.session import Session
from actuated_characters.viewer.web.server import serving
from msgs_config.character.loading import load_character
from msgs_config.errors import MotionError

_CHARACTER = "humanoid"


def show_editor(
    file: Path,
    character: str | None,
    *,
    host: str,
    port: int | None,
    fps: float,
    skin: GivenSkin | None = None,
) -> None:
    """Have a timeline made until an interruption; a file that is there goes on.

    `character` is the name or path of a new file's, by default the humanoid.

    Raises:
        ActuatedCharactersError: the file cannot be read, is of another character, or the port
            cannot be listened on.
    """
    document = Document(file, f"character: {character or _CHARACTER}\n")
    name = str(document.content.get("character", _CHARACTER))
    if character not in (None, name):
        raise MotionError(f"{file} is of the character '{name}'; leave --character out")
    session = Session(load_character(name), document)
    with serving(host, port) as (server, rejections, address):
        page = EditorPage(server, session, skin)
        for line in address:
            print(line, flush=True)
        try:
            page.play(fps, rejections)
        finally:
            page.takes.close()
