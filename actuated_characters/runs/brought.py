"""What a reconstructed clip brings along for its runs."""

from actuated_characters.runs.plan import SHARED
from controller_node.references.files.reconstructed import SUFFIX, FoundWith, ReconstructedClip
from msgs_config.character.model import Character


def bring_parameters(
    character: Character,
    clip: str | None,
    simulator: dict[str, object],
    controller: dict[str, object],
) -> FoundWith | None:
    """Set what a reconstructed clip was found with, unless it is set.

    Returns all that it was found with, None of other clips.

    Raises:
        ActuatedCharactersError: there is no such clip, or its file is malformed.
    """
    if clip is None or not clip.endswith(SUFFIX):
        return None
    found = ReconstructedClip(character, clip).found_with
    if found is None:
        return None
    taken = {name for name in SHARED if name in simulator or name in controller}
    for settings, brought in ((simulator, found.simulator), (controller, found.controller)):
        settings.update(
            {name: brought[name] for name in brought if name not in (*settings, *taken)}
        )
    return found
