"""The choices of an option that sets a parameter: those that the parameter's declaration has."""

import argparse
from collections.abc import Collection, Sequence
from functools import cached_property
from importlib import import_module
from typing import Protocol, overload


class ParameterChoices(Sequence[str]):
    """The choices of a parameter, looked up when they are asked for.

    A declaration brings all that registers its choices with it, which takes a while, and most
    commands need none.
    """

    def __init__(self, module: str, name: str, without: Collection[str] = ()) -> None:
        """Those of the parameter of a name in the module's `PARAMETERS`, but a few."""
        self._module, self._name, self._without = module, name, without

    @cached_property
    def _names(self) -> list[str]:
        declared = import_module(self._module).PARAMETERS
        (parameter,) = [each for each in declared if each.name == self._name]
        return [choice for choice in parameter.choices if choice not in self._without]

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...
    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        return self._names[index]

    def __len__(self) -> int:
        return len(self._names)


class Options(Protocol):
    """A parser, or a group of its options."""

    def add_argument(self, *names: str, help: str) -> argparse.Action:
        """Add an option."""
        ...


def add_choice(options: Options, name: str, choices: ParameterChoices, help: str) -> None:
    """Add an option with choices, which are looked up when it is given, or for help."""
    # Given to `add_argument` they would be looked up at once, for a check of the usage.
    options.add_argument(name, help=help).choices = choices
