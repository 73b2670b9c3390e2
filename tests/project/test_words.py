"""Names that need a dictionary of this project's do not come back."""

import ast
from collections.abc import Iterator
from pathlib import Path

PROJECT = Path(__file__).parents[2]
PACKAGES = ("msgs_config", "sim_node", "controller_node", "actuated_characters")
CLASSES = """
    Actor ActorMemory Role Cast Memory Saved Stage Puppet Canvas Camera View Set Shot Port
    WorldPort Outputs StampedInbox ContactInbox Inbox Outbox Patience Due Pace BackPressure
    CommandHold Verdict Push PushSchedule Throw ThrowSchedule Balls Probe Spinner Warnings
    Configuration Loading Plant Instant Drive Directive Carry MovedReference Way OwnWay
    ClipWay BodyWay GiveWay Hull Responding Deviations WindowFeedback Offset RunListener
    Claim Track Laboratory Findings Case Outcome
"""
FUNCTIONS = """
    make_cast make_role recall take_over is_stuck stand_back winds_up weaken conduct
    measure_mobility nearer_way
"""
PROSE = ("anew", "lest", "save that", "for ever", "nobody", "somebody", "whoever", "of its own")


def sources() -> Iterator[Path]:
    for package in PACKAGES:
        yield from (PROJECT / package).rglob("*.py")


def test_no_class_or_function_has_a_name_of_before() -> None:
    found, classes, functions = [], CLASSES.split(), FUNCTIONS.split()
    for source in sources():
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            old = classes if isinstance(node, ast.ClassDef) else functions
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name.lstrip("_") in old:
                found.append(f"{source.relative_to(PROJECT)}:{node.lineno}: {node.name}")

    assert not found


def test_prose_has_todays_words() -> None:
    pages = [PROJECT / "README.md", *(PROJECT / "docs").glob("*.md"), *sources()]
    found = []
    for page in pages:
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
            padded = f" {line} "
            found += [f"{page.name}:{number}: {word}" for word in PROSE if f" {word} " in padded]

    assert not found
