"""Random words that depend on nothing but their key and counter: numpy's Philox.

A generator's own normal draws may change with numpy; its raw words do not.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_MASK = 2**64 - 1


def random_words(key: Sequence[int], counter: Sequence[int], count: int) -> NDArray[np.uint64]:
    """Words (count,) of a key of two and a counter of four whole numbers, each modulo 2^64.

    Source: Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3" (Philox).
    """
    philox = np.random.Philox(
        counter=[word & _MASK for word in counter], key=[word & _MASK for word in key]
    )
    words: NDArray[np.uint64] = philox.random_raw(count)
    return words
