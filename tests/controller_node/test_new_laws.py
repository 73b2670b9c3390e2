"""A law is one registration: its parameters and all that others must know of it come with it."""

import json
import subprocess
import sys


def test_a_law_that_is_added_has_its_parameters_and_is_made_anew_when_they_change() -> None:
    """`ramp` grows with each answer since it was made; `spring` is 3, then 8, times 0.75 m."""
    command = [sys.executable, "-m", "tests.support.new_laws"]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = json.loads(said)

    assert found["spring"] == [2.25, 6.0, 6.0, [1]]
    *efforts, refused_here = found["ramp"]
    assert efforts == [1.0, 2.0, 3.0, 2.0, efforts[4], 4.0, 2.0]
    assert efforts[4] == "law 'ramp' needs 'ramp.step' up to 'spring.stiffness'"
    assert refused_here.startswith("law 'ramp' follows no target of an action; there are:")
    assert ", spring, stable_pd;" in refused_here
