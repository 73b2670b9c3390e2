"""Arrays in compiled code that count no owners.

numba counts the owners of each array, also of each view of a part, by instructions that lock memory
for all processors. In a tick of 20 us these take five, and more where threads share an array.
"""

from typing import Any, TypeVar

from numba import types
from numba.core import cgutils
from numba.core.extending import intrinsic
from numba.np.arrayobj import make_array

from msgs_config.compiled.decorator import compiled

_Held = TypeVar("_Held")


def _declare(_: Any, held: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _release(context, builder, signature.args[0], arguments[0])

    return held(held), generate


def _release(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """The value, with no owner of any array in it."""
    if isinstance(kind, types.Array):
        array = make_array(kind)(context, builder, value=value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        for place, each in enumerate(parts):
            part = builder.extract_value(value, place)
            value = builder.insert_value(value, _release(context, builder, each, part), place)
    return value


_without_owners: Any = intrinsic(_declare)


@compiled
def borrow(held: _Held) -> _Held:
    """An array, or a tuple of arrays, tuples and numbers, as it is; for compiled code alone.

    Whoever calls must have it as long as what is borrowed is used: as an argument of a compiled
    function, for instance, within that.
    """
    return _without_owners(held)  # type: ignore[no-any-return]
