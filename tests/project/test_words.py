"""Names that need a dictionary of this project's do not come back."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
PACKAGES = ("msgs_config", "sim_node", "controller_node", "actuated_characters")
FOLDERS = (*PACKAGES, "benchmarks", "examples", "launch", "tests")
WORDS = """
    Actor ActorMemory Role Cast Memory Saved Stage Puppet Canvas Camera View Set Shot Port
    WorldPort Outputs StampedInbox ContactInbox Inbox Outbox Patience Due Pace BackPressure
    CommandHold Verdict Push PushSchedule Throw ThrowSchedule Balls Probe Spinner Warnings
    Configuration Loading Plant Instant Drive Directive Carry MovedReference Way OwnWay
    ClipWay BodyWay GiveWay Hull Responding Deviations WindowFeedback Offset RunListener
    Claim Track Laboratory Findings Case Outcome Pusher Figures Said

    make_cast make_role recall take_over is_stuck stand_back winds_up weaken conduct
    measure_mobility nearer_way

    agreement aim answer caution doubt figures follow forget held kept last_resort listener
    looks lost memory mobility notes nudge offer plain pusher regulator said tried waiting
    yielding
    """
NAMES = frozenset(WORDS.split())
"""Of classes, functions, arguments, variables, attributes and modules."""
EXCEPTIONS = {"actuated_characters.studies.framework.result.StudyResult.__init__.figures"}
"""Qualified names in which the word is the field's own: matplotlib's figures."""
GIVEN: dict[type[ast.AST], str] = {
    ast.FunctionDef: "name",
    ast.AsyncFunctionDef: "name",
    ast.ClassDef: "name",
    ast.arg: "arg",
    ast.Name: "id",
    ast.Attribute: "attr",
    ast.alias: "asname",
    ast.ExceptHandler: "name",
    ast.MatchAs: "name",
    ast.MatchStar: "name",
    ast.MatchMapping: "rest",
}
"""The field of a node of the syntax tree that has the name that it gives."""
PROSE = ("anew", "lest", "save that", "for ever", "nobody", "somebody", "whoever", "of its own")


def sources(folders: tuple[str, ...] = PACKAGES) -> Iterator[Path]:
    for folder in folders:
        yield from (PROJECT / folder).rglob("*.py")


def forbidden(source: str, module: str) -> list[str]:
    """The names that a module and its code give and that are in `NAMES`, each with its line."""
    found = [(module, 1)] if module.rpartition(".")[2].lstrip("_") in NAMES else []
    scoped: list[tuple[str, ast.AST]] = [(module, ast.parse(source))]
    while scoped:
        scope, node = scoped.pop()
        name = given_name(node)
        if name is not None and name.lstrip("_") in NAMES:
            found.append((f"{scope}.{name}", getattr(node, "lineno", 1)))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            scope = f"{scope}.{node.name}"
        scoped += [(scope, child) for child in ast.iter_child_nodes(node)]
    return [f"{name}, line {line}" for name, line in found if name not in EXCEPTIONS]


def given_name(node: ast.AST) -> str | None:
    """The name that a node itself gives, without those inside it."""
    field = GIVEN.get(type(node))
    if field is None or isinstance(getattr(node, "ctx", None), ast.Load | ast.Del):
        return None
    name: str | None = getattr(node, field)
    return name


def test_nothing_has_a_name_of_before() -> None:
    found = []
    for file in sources(FOLDERS):
        module = ".".join(file.relative_to(PROJECT).with_suffix("").parts)
        found += forbidden(file.read_text(encoding="utf-8"), module)

    assert not found


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("class Push: pass", "module.Push, line 1"),
        ("def _answer(tick): pass", "module._answer, line 1"),
        ("class One:\n    async def offer(self): pass", "module.One.offer, line 2"),
        ("def check(*, mobility): pass", "module.check.mobility, line 1"),
        ("lambda held: None", "module.held, line 1"),
        ("first, *kept = 1, 2", "module.kept, line 1"),
        ("for lost in (): pass", "module.lost, line 1"),
        ("[tried for tried in ()]", "module.tried, line 1"),
        ("(figures := 1)", "module.figures, line 1"),
        ("with open(0) as listener: pass", "module.listener, line 1"),
        ("class One:\n    notes: list = ()", "module.One.notes, line 2"),
        ("def do(self):\n    self._waiting = None", "module.do._waiting, line 2"),
        ("import math as plain", "module.plain, line 1"),
        ("try: pass\nexcept OSError as doubt: pass", "module.doubt, line 2"),
        ("match 1:\n    case said: pass", "module.said, line 2"),
    ],
)
def test_a_name_of_before_is_found_wherever_it_is_given(source: str, name: str) -> None:
    assert forbidden(source, "module") == [name]


def test_a_module_of_such_a_name_is_found_and_the_use_of_other_peoples_names_is_not() -> None:
    assert forbidden("", "package.agreement") == ["package.agreement, line 1"]
    assert forbidden("result.figures\ncall(notes=1)\nimport lost.kept", "module") == []


def test_prose_has_todays_words() -> None:
    pages = [PROJECT / "README.md", *(PROJECT / "docs").glob("*.md"), *sources()]
    found = []
    for page in pages:
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), start=1):
            padded = f" {line} "
            found += [f"{page.name}:{number}: {word}" for word in PROSE if f" {word} " in padded]

    assert not found
