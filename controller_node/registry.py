"""Registries of control laws, references and behaviours by name."""

from collections.abc import Callable
from typing import Generic, TypeVar

from msgs_config.parameters import Parameter
from msgs_config.settings import Settings

Maker = TypeVar("Maker")


class Registry(Generic[Maker]):
    """Functions by name, each with the settings that it reads.

    A module registers its functions when it is imported, by
    `@REFERENCES.register("step", StepSettings)`.
    """

    def __init__(self) -> None:
        self._makers: dict[str, Maker] = {}
        self._settings: dict[str, tuple[type[Settings], ...]] = {}

    def register(self, name: str, *settings: type[Settings]) -> Callable[[Maker], Maker]:
        """Decorate the function of a name; several may read the same settings."""

        def add(maker: Maker) -> Maker:
            self._makers[name], self._settings[name] = maker, settings
            return maker

        return add

    def __getitem__(self, name: str) -> Maker:
        """The function of a name."""
        return self._makers[name]

    def settings(self, name: str) -> tuple[type[Settings], ...]:
        """The settings that the function of a name reads."""
        return self._settings[name]

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in alphabetical order, as modules may be imported in any."""
        return tuple(sorted(self._makers))

    @property
    def parameters(self) -> list[Parameter]:
        """The parameters of all, in the order of the names."""
        settings = dict.fromkeys(each for name in self.names for each in self._settings[name])
        return [parameter for each in settings for parameter in each.declared()]
