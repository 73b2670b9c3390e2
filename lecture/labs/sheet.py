"""What a lab asks, what was measured, and the points for it."""

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass, field

from lecture.labs.student import StudentError

FULL = 100


@dataclass(frozen=True)
class Measured:
    """What came out: whether that is what was asked, and the figure."""

    is_right: bool
    figure: str


@dataclass(frozen=True)
class Criterion:
    """A line of the table."""

    what: str
    asked: str
    measured: str
    points: int
    of: int
    error: str = ""  # the student's mistake that left nothing to measure


@dataclass
class Sheet:
    """The table of a lab; criteria are added in its order."""

    criteria: list[Criterion] = field(default_factory=list)
    hashes: list[str] = field(default_factory=list)
    """Of all states of each simulation, in their order."""
    report: Callable[[int], object] = lambda judged: None
    """Told how many points have been judged."""

    def judge(self, what: str, of: int, asked: str, measure: Callable[[], Measured]) -> None:
        """Add a criterion: all its points if what is measured is right, else none."""
        try:
            found, error = measure(), ""
        except StudentError as mistake:
            found, error = Measured(False, "-"), str(mistake)
        points = of if found.is_right else 0
        self.criteria.append(Criterion(what, asked, found.figure, points, of, error))
        self.report(sum(criterion.of for criterion in self.criteria))

    @property
    def points(self) -> int:
        """The points in all."""
        return sum(criterion.points for criterion in self.criteria)

    @property
    def errors(self) -> tuple[str, ...]:
        """The student's mistakes, each once."""
        return tuple(dict.fromkeys(each.error for each in self.criteria if each.error))

    @property
    def state_hash(self) -> str:
        """SHA-256 of the state hashes of all simulations."""
        return hashlib.sha256("\n".join(self.hashes).encode()).hexdigest()

    def as_json(self, lab: str) -> dict[str, object]:
        """All of it, as `--json` prints it."""
        return {
            "lab": lab,
            "points": self.points,
            "of": FULL,
            "criteria": [asdict(criterion) for criterion in self.criteria],
            "errors": list(self.errors),
            "state_hash": self.state_hash,
        }
