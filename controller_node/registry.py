"""Registries of control laws, references and behaviours by name."""

from collections.abc import Callable
from typing import Generic, TypeVar

from msgs_config.parameters import Parameter

Maker = TypeVar("Maker")


class Registry(Generic[Maker]):
    """Functions by name, each with the parameters that it reads.

    A module registers its functions when it is imported, by
    `@REFERENCES.register("step", *PARAMETERS)`.
    """

    def __init__(self) -> None:
        self._makers: dict[str, Maker] = {}
        self._parameters: dict[str, tuple[Parameter, ...]] = {}

    def register(self, name: str, *parameters: Parameter) -> Callable[[Maker], Maker]:
        """Decorate the function of a name."""

        def add(maker: Maker) -> Maker:
            self._makers[name], self._parameters[name] = maker, parameters
            return maker

        return add

    def __getitem__(self, name: str) -> Maker:
        """The function of a name."""
        return self._makers[name]

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in alphabetical order, as modules may be imported in any."""
        return tuple(sorted(self._makers))

    @property
    def parameters(self) -> list[Parameter]:
        """The parameters of all, in the order of the names."""
        return [parameter for name in self.names for parameter in self._parameters[name]]
