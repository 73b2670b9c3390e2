"""The settings of the behaviours that react to hits, checked."""

from dataclasses import replace

from msgs_config.character.model import Character
from msgs_config.clips.reading import available_clips
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import NO_GROUND, PLANE

REACTIONS = ("active_ragdoll", "pursuit", "reactive")
"""The behaviours that tell hits, and react to them."""


class ReactionSettings(Settings):
    """The settings of `active_ragdoll`, `pursuit` and `reactive`."""

    hit_threshold: float = parameter(
        3.0, "impulse of contacts that counts as a hit", name="hit.threshold", unit="N s"
    )
    limp_threshold: float = parameter(
        30.0, "impulse of a hit that makes it limp", name="limp.threshold", unit="N s"
    )
    react_duration: float = parameter(
        0.25,
        "how long it gives way to a hit of two thirds of limp.threshold or more; to a lighter one "
        "in proportion, at least 1/60 s",
        name="react.duration",
        unit="s",
        minimum=0.01,
        maximum=10,
    )
    softness: float = parameter(
        0.2, "strength of the joints at the struck link", name="react.softness", maximum=1.0
    )
    assistance: float = parameter(
        0.2,
        "largest root force while it gives way, as a share of the weight",
        name="react.assistance",
        maximum=1.0,
    )
    blend_duration: float = parameter(
        0.5,
        "how long it follows the motion that was found, and how long it takes to come back",
        name="blend.duration",
        unit="s",
        minimum=0.05,
        maximum=60.0,
    )
    library: tuple[str, ...] = parameter(
        (),
        "clips that a reaction may go on with: names, files, or folders of them; none named: all",
    )
    upright_torque: float = parameter(
        150.0,
        "active_ragdoll, pursuit: largest root torque",
        name="upright.torque",
        unit="N m",
    )
    brace_stiffness: float = parameter(
        4.0,
        "how many times as stiff the joints are that are asked to brace; as much damping as keeps "
        "its ratio",
        name="brace.stiffness",
        minimum=1.0,
        maximum=100.0,
    )
    recovery: str = parameter(
        "clip",
        "get up by a get-up clip, or straight back into the reference",
        choices=("clip", "ramp"),
    )
    recovery_duration: float = parameter(
        1.0,
        "in which the strengths come back from limp",
        name="recovery.duration",
        unit="s",
        minimum=0.05,
        maximum=60.0,
    )
    face_up: str = parameter(
        "getup_faceup", "clip that gets up from lying on the back", name="getup.faceup"
    )
    face_down: str = parameter(
        "getup_facedown", "clip that gets up from lying on the front", name="getup.facedown"
    )
    searches: bool = False  # whether it searches the library: the behaviour `reactive`

    @property
    def by_clip(self) -> bool:
        """Whether it gets up by a clip."""
        return self.recovery == "clip"


def check_terrain(behaviour: str, known: str, terrain: object) -> None:
    """Raise ConfigurationError if a behaviour cannot tell hits from what a ground does.

    `known` is the controller's parameter `terrain`; the simulator's is None if unknown.
    """
    if behaviour not in REACTIONS or terrain in (None, NO_GROUND):
        return
    if (known == PLANE) != (terrain == PLANE):
        raise ConfigurationError(
            f"parameter 'behaviour' is {behaviour}, which tells a hit from what the ground does: "
            f"controller_node's 'terrain' is {known}, but sim_node's is {terrain}; it must be the "
            "same"
        )


def reaction_settings(character: Character, values: Values, *, searches: bool) -> ReactionSettings:
    """The settings that the parameters' values say.

    Raises:
        ConfigurationError: the thresholds are in the wrong order, or a clip does not exist.
    """
    settings = replace(ReactionSettings.of(values), searches=searches)
    hit, limp = settings.hit_threshold, settings.limp_threshold
    if limp < hit:
        raise ConfigurationError(
            f"parameter 'limp.threshold' is {limp:g} N s; it must be 'hit.threshold', {hit:g} N s, "
            "or more"
        )
    clips = available_clips(character)
    get_ups = {"getup.faceup": settings.face_up, "getup.facedown": settings.face_down}
    for name, clip in get_ups.items():
        if settings.by_clip and clip not in clips:
            wrong = one_of(f"clip in parameter '{name}':", clip, clips)
            raise ConfigurationError(f"{wrong}; with 'recovery' at 'ramp' it needs none")
    return settings
