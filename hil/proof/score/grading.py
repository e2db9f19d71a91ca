"""An answer held against the truth: what is right in it, and how far its numbers are off."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from hil.diagnosis.wording import title
from hil.proof.answer.answers import ABSENT, FAILED, Named, Reply
from hil.proof.draw.expected import same_law
from hil.proof.draw.generator import Concealed, Truth
from hil.proof.score.distances import difference, overlap, relative_error
from hil.twin.library import BY_ID, names_of
from hil.twin.mechanism import Role

NORMAL_90 = 1.645  # standard errors to either side of a 90 % interval
ABOVE_FLOOR = 1.0  # size, in units of noise, from which on an effect is above the noise floor
# Parameters that say where an effect is: scored as its place, not once more as its parameters.
_PLACES = names_of(Role.ORDER, Role.PERIOD, Role.EDGE, Role.FREQUENCY)


def _has_frequency(effect: str) -> bool:
    """Check that an effect of the library is scored by its frequency."""
    return effect in BY_ID and bool(BY_ID[effect].indices(Role.FREQUENCY))


@dataclass(frozen=True)
class Marked:
    """A case with its answer, and the answer after the motion that the diagnosis asked for was run too."""

    truth: Truth
    reply: Reply
    later: Reply | None = None

    @property
    def concealed(self) -> Concealed | None:
        """What the case is about; None where nothing is concealed."""
        return self.truth.effects[0] if self.truth.effects else None

    @property
    def first(self) -> Named | None:
        """What was named first."""
        return self.reply.named[0] if self.reply.named else None

    @property
    def size(self) -> float:
        """Of the largest concealed effect, in units of noise."""
        return max((effect.size for effect in self.truth.effects), default=0.0)

    @property
    def above_floor(self) -> bool:
        """Whether an effect is concealed that these motions show above the noise."""
        return self.size >= ABOVE_FLOOR and self.truth.tier != "insufficient"

    @property
    def detected(self) -> bool:
        """Whether something is said to be missing, with a name or without."""
        return self.reply.verdict in ("missing_physics", "unexplained")

    @property
    def top(self) -> bool:
        """Whether what the case is about was named first."""
        return self.first is not None and self.first.effect in self._laws(0)

    @property
    def in_set(self) -> bool:
        """Whether it is what was named first or what that is said not to be told from."""
        return self.first is not None and bool(self.first.reported & self._laws(0))

    @cached_property
    def matched(self) -> tuple[Named | None, ...]:
        """For each concealed effect the finding that names it, none of them twice."""
        left, found = list(self.reply.named), []
        for index in range(len(self.truth.effects)):
            match = next((named for named in left if named.effect in self._laws(index)), None)
            found.append(match)
            if match is not None:
                left.remove(match)
        return tuple(found)

    @property
    def spurious(self) -> tuple[Named, ...]:
        """Findings that name nothing that is there, and whose set holds nothing that is there and unnamed."""
        open_laws = frozenset[str]().union(
            *(self._laws(index) for index, found in enumerate(self.matched) if found is None)
        )
        taken = [id(found) for found in self.matched]
        return tuple(named for named in self.reply.named if id(named) not in taken and not named.reported & open_laws)

    @property
    def unanswered(self) -> bool:
        """Whether there is no answer."""
        return self.reply.verdict in (FAILED, ABSENT)

    @property
    def names_something(self) -> bool:
        """Whether something is named, rightly or not; an answer that is wanting is as wrong."""
        return bool(self.reply.named) or self.unanswered

    @property
    def names_too_much(self) -> bool:
        """Whether something is named that is not there; an answer that is wanting is as wrong."""
        return bool(self.spurious) or self.unanswered

    @property
    def blurred(self) -> bool:
        """Whether the set named first holds more than what is concealed and what this motion cannot tell from it."""
        return self.first is not None and bool(self.first.reported - self._laws(0))

    @property
    def block_right(self) -> bool:
        """Whether the mismatch is placed in the block of a concealed effect."""
        return self.reply.location.get("block") in {effect.block for effect in self.truth.effects}

    @property
    def set_reported(self) -> bool:
        """Whether the effect and all its rivals are reported as one set."""
        return (
            self.first is not None
            and bool(self.first.reported & self._law(0))
            and all(self.first.reported & {rival, *same_law(rival)} for rival in self.truth.rivals)
        )

    @property
    def resolved(self) -> bool:
        """Whether the motion that was asked for left the concealed effect alone, without its rivals."""
        if self.later is None or not self.later.named:
            return False
        first = self.later.named[0]
        return first.effect in self._law(0) and not first.reported & (self._laws(0) - self._law(0))

    @property
    def called_untestable(self) -> bool:
        """Whether what the motion cannot show is called not testable, and not named."""
        hidden = set(self.truth.not_testable)
        return bool(hidden & set(self.reply.not_testable)) and not any(
            named.effect in hidden for named in self.reply.named
        )

    @property
    def right(self) -> bool:
        """Whether the answer as a whole is the right one: everything that is there named, and nothing else. Below the
        noise it is right to name nothing, too."""
        if self.unanswered:
            return False
        if self.truth.tier == "ambiguous":
            return self.set_reported and not self.spurious
        if self.truth.tier == "insufficient":
            return self.called_untestable and not self.reply.named
        if not self.truth.effects or self.truth.tier == "novel":
            return self.reply.verdict == self.truth.verdict and not self.reply.named
        if not self.above_floor and not self.reply.named:
            return True
        return all(self.matched) and not self.spurious

    @property
    def wrong(self) -> str:
        """What is wrong with the answer, in words; empty where it is right."""
        if self.right:
            return ""
        if self.unanswered:
            return "There is no diagnosis."
        if self.spurious:
            return f"It names {_listed(named.effect for named in self.spurious)}, which is not there."
        if self.truth.tier == "ambiguous" and self.top:
            return f"It does not say that {_listed(self.truth.rivals)} cannot be told from what it names."
        if self.truth.tier == "insufficient":
            return f"It does not say that this motion cannot show {_listed(self.truth.not_testable, 'or')}."
        unnamed = [effect.effect for effect, found in zip(self.truth.effects, self.matched, strict=True) if not found]
        if self.truth.tier != "novel" and unnamed:
            return f"It does not name {_listed(unnamed)}."
        return f"The verdict is {title(self.reply.verdict)} instead of {title(self.truth.verdict)}."

    def named_right(self, named: Named) -> bool:
        """Whether what a finding names is there."""
        return any(named is found for found in self.matched)

    def parameter_errors(self) -> dict[str, float]:
        """Relative errors of the parameters of what was named first and rightly."""
        return {
            name: relative_error(name, value, self._known())
            for name, (value, _) in self._estimated().items()
            if name not in _PLACES
        }

    def covered(self) -> dict[str, bool]:
        """Whether the 90 % interval of each parameter of what was named first and rightly holds the true value."""
        known = self._known()
        return {
            name: difference(name, value, known[name]) <= NORMAL_90 * deviation
            for name, (value, deviation) in self._estimated().items()
            if name not in names_of(Role.ORDER)
        }

    def nominal_errors(self) -> dict[str, float]:
        """Relative errors of the corrected parameters of the bench."""
        true = self.truth.true_parameters
        return {name: abs(value / true[name] - 1.0) for name, (value, _) in self.reply.nominal.items() if true[name]}

    def period_error(self) -> float | None:
        """Relative error of the spatial period, infinite where none is given; None for what has no free period."""
        if self.concealed is None or not {*names_of(Role.PERIOD, Role.ORDER)} & set(self.concealed.parameters):
            return None
        lead_m = self.truth.true_parameters.get("lead_m") or self.truth.true_parameters["screw_lead_m"]
        true = float(self.concealed.place["period_m"])  # type: ignore[arg-type]
        period_m, order = self._said(Role.PERIOD, "period_m"), self._said(Role.ORDER, "order_per_rev")
        found = lead_m / order if order else period_m
        return abs(found / true - 1.0) if found else float("inf")

    def frequency_error(self) -> float | None:
        """Relative error of the frequency of a mode, infinite where none is given; None for other effects."""
        if self.concealed is None or not _has_frequency(self.concealed.effect):
            return None
        found = self._said(Role.FREQUENCY, "frequency_hz")
        true = float(self.concealed.place["frequency_hz"])  # type: ignore[arg-type]
        return abs(found / true - 1.0) if found else float("inf")

    def window_overlap(self) -> float | None:
        """Intersection over union of the windows said and the true one; None for what has no window."""
        if self.concealed is None or "window_s" not in self.concealed.place:
            return None
        named = self.first.parameters if self.first else {}
        edges = [named[name][0] for name in names_of(Role.EDGE) if name in named]
        windows = [(edges[0], edges[1])] if edges else self.reply.location.get("windows_s", [])
        return overlap(windows, *self.concealed.place["window_s"])  # type: ignore[misc]

    def _said(self, role: Role, key: str) -> float | None:
        """The parameter of a role in the first finding, or else the entry of the location."""
        named = self.first.parameters if self.first else {}
        found: float | None = next((named[name][0] for name in names_of(role) if name in named), None)
        return self.reply.location.get(key) if found is None else found

    def _estimated(self) -> dict[str, tuple[float, float]]:
        if not self.top or self.first is None:
            return {}
        return {name: found for name, found in self.first.parameters.items() if name in self._known()}

    def _known(self) -> Mapping[str, float]:
        return self.concealed.compared if self.concealed else {}

    def _law(self, index: int) -> frozenset[str]:
        """Ids that say what a concealed effect is."""
        return frozenset(self.truth.effects[index].same_law) if index < len(self.truth.effects) else frozenset()

    def _laws(self, index: int) -> frozenset[str]:
        """The same, with those that this motion cannot tell from the first one."""
        laws = self._law(index)
        return laws.union(*(({rival, *same_law(rival)}) for rival in self.truth.rivals)) if index == 0 else laws


def _listed(names: Iterable[str], last: str = "and") -> str:
    words = [title(name) for name in names]
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
