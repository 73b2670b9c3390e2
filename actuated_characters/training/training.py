"""The course of a training: episodes, learning, and now and then a look at how good a policy is."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from actuated_characters.training.episode_types import CUT, FELL, Taught, Trace
from actuated_characters.training.job import Job, decisions_of
from actuated_characters.training.learner import Learner, LearningSettings, copy_of
from actuated_characters.training.references import make_scales, make_table
from actuated_characters.training.teachers import Teachers, heard
from actuated_characters.training.worlds import LARGEST_ACTION, TrainingWorlds
from controller_node.planner.compiled.network import Network
from controller_node.planner.policy.file import Policy, write_policy
from msgs_config.arrays import FloatArray

_WORLDS, _DECISIONS = 64, 48  # of a trace
_SPREADS = (1.0, 0.3)  # standard deviation of what is tried, at first and in the end
_RATES = (1.2e-3, 2e-4)  # of a policy's steps, at first and in the end
_TAUGHT_RATE = 1e-3  # the same while teachers are heard alone: what they say does not scatter
_FROM = 0.5  # of that course, from where on it goes where it has what other policies can
_LEAST_PUSH = 5.0  # N s, up to which pushes are at first
_RARE, _OFTEN = 0.2, 0.4  # falls a second, below which pushes grow and above which they shrink
_GROWS, _SHRINKS = 0.15, 0.1  # N s a trace
_LATELY = 0.05  # share of a trace in the mean of falls
_AVERAGED = 0.02  # of a training, over which its networks are averaged
_LOOKS = 20  # at how good a policy is, in a training
_LOOKS_TAKE = 0.05  # decisions of all looks, against those of the training
_LOOK_WORLDS, _LOOK_S = 16, 10.0  # least worlds
_FALL_COSTS = 1.0  # reward, of one fall a second


@dataclass(frozen=True)
class Look:
    """How good a policy is, without what is tried."""

    seconds: float  # of all worlds together
    falls: int  # in them, half of them pushed where it learns to take pushes
    is_better: bool  # than all before, and is kept


@dataclass(frozen=True)
class Progress:
    """How far a training is, and what its worlds, with all that is tried and pushed, are like."""

    decisions: int
    survived_s: float  # mean length of episodes that ended
    off_m: float  # median of the centre of mass
    off_rad: float  # median of a joint
    push: float  # N s, up to which pushes are
    look: Look | None  # now and then


Kept: TypeAlias = tuple[Network, Network, Mapping[str, object], float]
"""Policy, value, what they were trained with, and what is expected while it is calm."""


class Training:
    """Policies of a job, one better than the other. The same job gives the same policies."""

    def __init__(self, job: Job, start: Policy | None = None, *, resumes: bool = False) -> None:
        """Build worlds and networks; from a policy's, where there is one.

        `resumes` says that its training goes on, rather than that another one begins with it.
        """
        self._job = job
        self._done = decisions_of(start) if start and resumes else 0
        self._from = None
        if start is not None and resumes:
            self._from = start.about["trained"].get("from")
        elif start is not None:
            self._from = {"clips": start.about["clips"], "decisions": decisions_of(start)}
        self._worlds, self._judges = (
            TrainingWorlds(job.character, job.settings, job.gains, threads=job.threads)
            for _ in range(2)
        )
        model, body = self._worlds.model, self._worlds.body
        rate = job.settings.parameters.rate_hz
        self._table, self._starts = make_table(model, body, job.references, rate)
        self._scales = (
            start.scales if start else make_scales(self._table, self._starts, model.feature_layout)
        )
        learning, trying = (
            np.random.default_rng((job.seed, number, self._done)) for number in (0, 1)
        )  # other ones where it goes on
        self._worlds.begin(self._table, self._starts, self._scales, _WORLDS, trying)
        self._imitated = [
            name for name, each in zip(job.names, job.teachers, strict=False) if each is not None
        ]
        self._most_heard = 1.0
        if start is not None and resumes:  # what was learnt without teachers is not to be undone
            self._imitated = start.about["trained"].get("imitated", self._imitated)
            self._most_heard = start.about["trained"].get("heard", 1.0)
        self._teachers = Teachers(job.teachers, self._starts, self._scales)
        rules = self._worlds.rules
        self._decision_s = rules.hold * rules.period
        inputs = len(self._scales.deviation) + self._scales.frame_mean.size
        traces = job.decisions / (_WORLDS * _DECISIONS)
        averaged = max(round(_AVERAGED * traces), 1)
        settings = LearningSettings(largest=LARGEST_ACTION, averaged=averaged)
        self._learner = Learner((inputs, job.hidden, len(rules.unit)), learning, settings)
        self._push, self._falls = _LEAST_PUSH, _OFTEN
        self._looked = self._done * _LOOKS // job.decisions
        self._lengths: list[float] = []
        self._best = -np.inf  # score
        self._kept: Kept | None = None  # the best so far
        if start is not None:
            self._learner.take(start.network, start.value)
        if start is not None and resumes:
            self._push = float(start.about["trained"].get("pushes_ns", _LEAST_PUSH))
            self._look()

    def close(self) -> None:
        """End its threads."""
        for each in (self._worlds, self._judges):
            each.close()
        self._learner.close()

    @property
    def done(self) -> int:
        """How many decisions were made."""
        return self._done

    @property
    def has_best(self) -> bool:
        """Whether a policy was found good enough to be kept: at the first look."""
        return self._kept is not None

    @property
    def is_over(self) -> bool:
        """Whether all decisions of the job are made."""
        return self._done >= self._job.decisions

    def go_on(self) -> Progress:
        """Run episodes for a while, and learn from them."""
        spread, rate = self._spread_and_rate()
        push = min(self._push, self._job.most_push)
        trace, noise = self._worlds.run(self._learner.policy, _DECISIONS, spread, push)
        self._learner.learn(trace, noise, spread, rate, self._taught(trace))
        self._worlds.prefer_hard_starts(trace)
        self._done += trace.rewards.size
        self._lead_pushes(trace)
        is_due = self._done * _LOOKS >= (self._looked + 1) * self._job.decisions
        look = self._look() if is_due or self.is_over else None
        return self._progress(trace, push, look)

    def save(self, path: Path, figures: Mapping[str, object]) -> None:
        """Write the best policy so far, with the figures that it was accepted with."""
        write_policy(path, self.best(figures))

    def best(self, figures: Mapping[str, object]) -> Policy:
        """The best policy so far; there is one from the first look on."""
        assert self._kept is not None
        job, rules = self._job, self._worlds.rules
        network, value, trained, calm = self._kept
        about = {
            "character": job.character.name,
            "dofs": list(job.character.layout.dof_names),
            "clips": list(job.names),
            **({"gait": list(job.gait)} if job.gait else {}),
            "rate": job.settings.parameters.rate_hz,
            "hold": rules.hold,
            "mass": round(job.character.mass, 6),
            "gravity": job.settings.parameters.gravity,
            "calm": round(calm, 4),
            "largest": rules.largest,
            "trained": trained,
            "figures": figures,
        }
        gains = job.gains.stiffness, job.gains.damping
        return Policy(about, network, value, self._scales, self._table.ahead, rules.unit, *gains)

    def _spread_and_rate(self) -> tuple[float, float]:
        """Of what is tried, and of the policy's steps, by how far the training is."""
        share = min(self._done / self._job.decisions, 1.0)
        if self._from is not None or self._imitated:
            share = _FROM + (1.0 - _FROM) * share
        spread, rate = (first * (last / first) ** share for first, last in (_SPREADS, _RATES))
        return spread, rate + self._heard * (_TAUGHT_RATE - rate)

    @property
    def _heard(self) -> float:
        """How much teachers count now."""
        if not any(self._job.teachers):
            return 0.0
        return min(heard(self._done / self._job.decisions), self._most_heard)

    def _taught(self, trace: Trace) -> Taught | None:
        """What teachers would have done in a trace."""
        observations = trace.observations.reshape(trace.rewards.size, -1)
        return self._teachers.answer(observations, trace.rows.ravel(), self._heard)

    def _lead_pushes(self, trace: Trace) -> None:
        falls = float((trace.ends == FELL).mean()) / self._decision_s
        self._falls += _LATELY * (falls - self._falls)
        by = _GROWS if self._falls < _RARE else -_SHRINKS if self._falls > _OFTEN else 0.0
        self._push = float(np.clip(self._push + by, _LEAST_PUSH, max(self._job.most_push, 0.0)))

    def _look(self) -> Look:
        """Keep the policy if it is the best so far, in episodes as it would be used."""
        self._looked = self._done * _LOOKS // self._job.decisions
        pushes = sorted({0.0, self._job.most_push})
        decisions = round(_LOOK_S / self._decision_s)
        share = _LOOKS_TAKE * self._job.decisions / _LOOKS / len(pushes)
        worlds = max(_LOOK_WORLDS, round(share / decisions))
        traces = [self._exam(push, worlds, decisions) for push in pushes]
        score = sum(map(self._score, traces))
        is_better = score >= self._best
        if is_better:
            calm = self._learner.least_expected(traces[0])
            self._best, self._kept = score, self._current(calm)
        falls = sum(int((each.ends == FELL).sum()) for each in traces)
        return Look(len(traces) * worlds * _LOOK_S, falls, is_better)

    def _exam(self, most_push: float, worlds: int, decisions: int) -> Trace:
        """Episodes that are the same each time but for what the policy does."""
        draws = np.random.default_rng((self._job.seed, 2))
        self._judges.begin(self._table, self._starts, self._scales, worlds, draws)
        policy, _ = self._learner.averages
        trace, _ = self._judges.run(policy, decisions, 0.0, most_push)
        return trace

    def _score(self, trace: Trace) -> float:
        """Reward, less falls."""
        falls = float((trace.ends == FELL).mean()) / self._decision_s
        return float(trace.rewards.mean()) - _FALL_COSTS * falls

    def _current(self, calm: float) -> Kept:
        """Copies of policy and value, and what they were trained with."""
        job, (policy, value) = self._job, self._learner.averages
        trained = {
            "decisions": self._done,
            "seed": job.seed,
            "pushes_ns": round(min(self._push, job.most_push), 1),
            **({"after": list(job.after)} if job.after else {}),
            **({} if self._from is None else {"from": self._from}),
            **({"imitated": self._imitated, "heard": self._heard} if self._imitated else {}),
        }
        return copy_of(policy), copy_of(value), trained, calm

    def _progress(self, trace: Trace, push: float, look: Look | None) -> Progress:
        ended = trace.lengths[(trace.ends == FELL) | (trace.ends == CUT)]
        self._lengths = (self._lengths + ended.tolist())[-4 * _WORLDS :]
        lasted = float(np.mean(self._lengths)) if self._lengths else 0.0
        centre, joints = self._scales.centre, self._table.velocities.shape[1] - 6
        off = trace.observations[..., : len(self._scales.deviation)] * self._scales.deviation
        places: FloatArray = np.linalg.norm(off[..., centre : centre + 3], axis=-1)
        turns = np.abs(off[..., 3 : 3 + joints])
        return Progress(
            self._done,
            lasted * self._decision_s,
            float(np.median(places)),
            float(np.median(turns.mean(axis=-1))),
            push,
            look,
        )
