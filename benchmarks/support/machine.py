"""The machine that measures, in words: a ratio says little without it."""

import os
import platform
from pathlib import Path

_FACTS = Path("/proc/cpuinfo")  # proc(5)
_MODEL = "model name"


def describe_machine() -> str:
    """The processor's model, or its architecture where Linux does not say, and how many."""
    model = platform.processor() or platform.machine()
    if _FACTS.exists():
        for line in _FACTS.read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == _MODEL:
                model = value.strip()
                break
    return f"{model}, {os.cpu_count()} processors"
