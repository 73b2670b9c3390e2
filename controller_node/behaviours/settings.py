"""The parameters of the behaviours that react to hits, checked."""

from dataclasses import dataclass

from msgs_config.character.model import Character
from msgs_config.clips.reading import available_clips
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.parameters import Parameter, Values
from msgs_config.shared_parameters import NO_GROUND, PLANE

_TELLS_HITS = ("active_ragdoll", "pursuit", "reactive")

REACTION_PARAMETERS = [
    Parameter("hit.threshold", 3.0, "impulse of contacts that counts as a hit", unit="N s"),
    Parameter("limp.threshold", 30.0, "impulse of a hit that makes it limp", unit="N s"),
    Parameter(
        "react.duration",
        0.25,
        "how long it gives way to a hit of two thirds of limp.threshold or more; to a lighter one "
        "in proportion, at least 1/60 s",
        unit="s",
        minimum=0.01,
        maximum=10,
    ),
    Parameter("react.softness", 0.2, "strength of the joints at the struck link", maximum=1.0),
    Parameter(
        "react.assistance",
        0.2,
        "largest root force while it gives way, as a share of the weight",
        maximum=1.0,
    ),
    Parameter(
        "blend.duration",
        0.5,
        "how long it follows the motion that was found, and how long it takes to come back",
        unit="s",
        minimum=0.05,
        maximum=60.0,
    ),
    Parameter(
        "library",
        [],
        "clips that a reaction may go on with: names, files, or folders of them; none named: all",
        texts=True,
    ),
    Parameter("upright.torque", 150.0, "active_ragdoll, pursuit: largest root torque", unit="N m"),
    Parameter(
        "recovery",
        "clip",
        "get up by a get-up clip, or straight back into the reference",
        choices=("clip", "ramp"),
    ),
    Parameter(
        "recovery.duration",
        1.0,
        "in which the strengths come back from limp",
        unit="s",
        minimum=0.05,
        maximum=60.0,
    ),
    Parameter("getup.faceup", "getup_faceup", "clip that gets up from lying on the back"),
    Parameter("getup.facedown", "getup_facedown", "clip that gets up from lying on the front"),
]


@dataclass(frozen=True)
class ReactionSettings:
    """The settings of `active_ragdoll`, `pursuit` and `reactive`."""

    searches: bool  # whether it searches the library: the behaviour `reactive`
    hit_threshold: float  # N s
    limp_threshold: float  # N s
    react_duration: float  # s
    softness: float
    assistance: float  # largest root force while it gives way, in weights
    blend_duration: float  # s
    library: tuple[str, ...]
    upright_torque: float  # N m, of active_ragdoll and pursuit
    by_clip: bool  # whether it gets up by a clip
    recovery_duration: float  # s
    face_up: str  # the get-up clips of lying on the back, and on the front
    face_down: str


def check_terrain(behaviour: str, terrain: object) -> None:
    """Raise ConfigurationError if a behaviour cannot tell hits from what a ground does.

    It knows the plane at z = 0 alone. `terrain` is the simulator's parameter, None if unknown.
    """
    if behaviour in _TELLS_HITS and terrain not in (None, PLANE, NO_GROUND):
        raise ConfigurationError(
            f"parameter 'behaviour' is {behaviour}, which tells a hit from the ground at z = 0, "
            f"but sim_node's 'terrain' is {terrain}; it must be {PLANE} or {NO_GROUND}"
        )


def reaction_settings(character: Character, values: Values) -> ReactionSettings:
    """The settings that the parameters' values say.

    Raises:
        ConfigurationError: the thresholds are in the wrong order, or a clip does not exist.
    """
    hit, limp = values.number("hit.threshold"), values.number("limp.threshold")
    if limp < hit:
        raise ConfigurationError(
            f"parameter 'limp.threshold' is {limp:g} N s; it must be 'hit.threshold', {hit:g} N s, "
            "or more"
        )
    by_clip = values.text("recovery") == "clip"
    clips = available_clips(character)
    for name in ("getup.faceup", "getup.facedown"):
        if by_clip and values.text(name) not in clips:
            wrong = one_of(f"clip in parameter '{name}':", values.text(name), clips)
            raise ConfigurationError(f"{wrong}; with 'recovery' at 'ramp' it needs none")
    return ReactionSettings(
        searches=values.text("behaviour") == "reactive",
        hit_threshold=hit,
        limp_threshold=limp,
        react_duration=values.number("react.duration"),
        softness=values.number("react.softness"),
        assistance=values.number("react.assistance"),
        blend_duration=values.number("blend.duration"),
        library=values.texts("library"),
        upright_torque=values.number("upright.torque"),
        by_clip=by_clip,
        recovery_duration=values.number("recovery.duration"),
        face_up=values.text("getup.faceup"),
        face_down=values.text("getup.facedown"),
    )
