"""Changes of a node's parameters while it runs."""

from collections.abc import Callable, Iterable, Mapping

from msgs_config.bus.node import BusNode
from msgs_config.errors import ActuatedCharactersError
from msgs_config.parameters import Parameter, Values, resolve


class LiveParameters:
    """Changes of a node's parameters: checked before any is taken, all or none."""

    def __init__(
        self,
        node: BusNode,
        parameters: Iterable[Parameter],
        values: Values,
        take: Callable[[Values], None],
        check: Callable[[Values], object] = lambda values: None,
    ) -> None:
        """Hand all values, the changed ones among them, to `take` after each change.

        `check` may refuse them before, by an ActuatedCharactersError.
        """
        self._node = node
        self._check_values = check
        self._parameters = list(parameters)
        self._values = values
        self._take = take
        node.watch_parameters(self.refusal, self._change)

    def declare(self, parameters: Iterable[Parameter], values: Values) -> None:
        """Declare parameters whose values were not known before."""
        late = list(parameters)
        self._values = Values(self._values | {each.name: values[each.name] for each in late})
        self._node.declare(late, values)

    def refusal(self, changes: Mapping[str, object]) -> str:
        """Why changes cannot be taken; empty if they can."""
        try:
            self._check_values(self._with(changes))
        except ActuatedCharactersError as error:
            return str(error)
        return ""

    def _change(self, changes: Mapping[str, object]) -> None:
        self._values = self._with(changes)
        self._take(self._values)

    def _with(self, changes: Mapping[str, object]) -> Values:
        return resolve(self._parameters, {**self._values, **changes})
