"""What a controller may change from one tick to the next: its law, gains and balance."""

from dataclasses import dataclass

from controller_node.balance import BalanceGains
from controller_node.control_laws import LAWS, GainArrays, Law, LawContext, scale_gains
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.errors import ConfigurationError
from msgs_config.settings import Settings, parameter


class LawSettings(Settings):
    """Which law it is, and of what."""

    law: str = parameter("stable_pd", "the control law", choices=LAWS.names, live=True)
    feedforward: str = parameter(
        "",
        "the law feedforward's CSV file: time_s and degrees of freedom's efforts",
        at_reset=True,
    )


@dataclass(frozen=True)
class ControllerSettings:
    """The law, its gains and the balance, which may change from one tick to the next."""

    law: str
    gains: GainArrays
    follows_velocity: bool  # the reference's; else the desired velocity is zero
    balance: BalanceGains | None = None  # None: nothing but the law
    strengths: FloatArray | None = None  # (b,) shares of the gains that count; None: all of them
    law_settings: tuple[Settings, ...] = ()  # those that the law is registered with

    def make_law(self, context: LawContext) -> Law:
        """The law, at the beginning of an episode. Raises ConfigurationError if it cannot be."""
        return LAWS[self.law].make(context, *self.law_settings)


def check_planned(settings: ControllerSettings) -> None:
    """Raise ConfigurationError if a planner cannot work with settings."""
    if settings.law != "stable_pd":
        raise ConfigurationError(
            f"a planner foresees the law stable_pd alone; 'law' is {settings.law}"
        )
    if settings.balance is not None:
        raise ConfigurationError("a planner keeps balance itself; 'balance.enabled' must be false")


def check_unaided(settings: ControllerSettings) -> None:
    """Raise ConfigurationError if settings add to a behaviour that makes the effort itself."""
    if settings.law != "stable_pd":
        raise ConfigurationError(
            f"the behaviour makes the effort beside the law stable_pd; 'law' is {settings.law}"
        )
    if settings.balance is not None:
        raise ConfigurationError(
            "the behaviour keeps balance itself; 'balance.enabled' must be false"
        )


@dataclass(frozen=True)
class EffectiveGains:
    """The gains in force until settings or strengths change."""

    from_messages: FloatArray  # (b,) the strengths that messages set
    strengths: FloatArray  # (b,) those of messages times the settings' own
    gains: GainArrays  # the settings' gains times these strengths
    assisted: bool  # whether the gains drive a floating base


def effective_gains(
    layout: JointLayout, settings: ControllerSettings, strengths: FloatArray
) -> EffectiveGains:
    """The settings' gains times their own strengths (b,) and those that messages set (b,)."""
    gains, own = settings.gains, settings.strengths
    both = strengths if own is None else own * strengths
    if own is not None:
        gains = scale_gains(layout, gains, own)
    gains = scale_gains(layout, gains, strengths)
    root = gains.stiffness[:6].any() or gains.damping[:6].any()
    return EffectiveGains(strengths, both, gains, layout.has_floating_base and bool(root))
