"""Grade an answer against the truth: names, block, parameters and place."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, pi, remainder

from hil.diagnosis.wording import title
from hil.twin.library import names_of
from hil.twin.parameter import Role
from hil.validation.proof.answer.answers import ABSENT, FAILED, Answer, Named
from hil.validation.proof.draw.expected import OTHER_FORM, OTHER_VERDICT, same_law
from hil.validation.proof.draw.generator import Concealed, Truth

NORMAL_90 = 1.645  # standard errors to either side of a 90 % interval
ABOVE_FLOOR = 1.0  # smallest size, in units of noise, of an effect above the noise floor
# Parameters that locate an effect: they are scored as its place, not among its parameters.
_PLACES = names_of(Role.ORDER, Role.PERIOD, Role.EDGE, Role.FREQUENCY)


@dataclass(frozen=True)
class GradedCase:
    """A case with its answer, and the answer after the proposed motion was recorded too."""

    truth: Truth
    answer: Answer
    later: Answer | None = None

    @property
    def concealed(self) -> Concealed | None:
        """The effect to be found; None if nothing is concealed."""
        return self.truth.effects[0] if self.truth.effects else None

    @property
    def first(self) -> Named | None:
        """The first finding."""
        return self.answer.named[0] if self.answer.named else None

    @property
    def size(self) -> float:
        """Size of the largest concealed effect, in units of noise."""
        return max((effect.size for effect in self.truth.effects), default=0.0)

    @property
    def above_floor(self) -> bool:
        """True if these motions show a concealed effect above the noise."""
        return self.size >= ABOVE_FLOOR and self.truth.tier != "insufficient"

    @property
    def detected(self) -> bool:
        """True if the answer says that something is missing, with a name or without."""
        return self.answer.verdict in ("missing_physics", "unexplained", "axis_changed")

    @property
    def top(self) -> bool:
        """True if the first finding is the effect to be found."""
        return self.first is not None and self.first.effect in self._laws(0)

    @property
    def in_set(self) -> bool:
        """True if the effect to be found is the first finding or one of its equivalents."""
        return self.first is not None and bool(self.first.reported & self._laws(0))

    @cached_property
    def matched(self) -> tuple[Named | None, ...]:
        """The finding for each concealed effect; each finding is used once."""
        left, found = list(self.answer.named), []
        for index in range(len(self.truth.effects)):
            match = next((named for named in left if named.effect in self._laws(index)), None)
            found.append(match)
            if match is not None:
                left.remove(match)
        return tuple(found)

    @property
    def spurious(self) -> tuple[Named, ...]:
        """Findings that name no concealed effect and have no unnamed concealed effect among their equivalents."""
        open_laws = frozenset[str]().union(
            *(self._laws(index) for index, found in enumerate(self.matched) if found is None)
        )
        taken = [id(found) for found in self.matched]
        return tuple(named for named in self.answer.named if id(named) not in taken and not named.reported & open_laws)

    @property
    def unanswered(self) -> bool:
        """True if the diagnosis failed or is missing."""
        return self.answer.verdict in (FAILED, ABSENT)

    @property
    def names_something(self) -> bool:
        """True if something is named, right or wrong; a missing answer counts too."""
        return bool(self.answer.named) or self.unanswered

    @property
    def names_too_much(self) -> bool:
        """True if there is a spurious finding; a missing answer counts too."""
        return bool(self.spurious) or self.unanswered

    @property
    def blurred(self) -> bool:
        """True if the first set has more than the concealed effect and what this motion cannot separate from it."""
        return self.first is not None and bool(self.first.reported - self._laws(0))

    @property
    def block_right(self) -> bool:
        """True if the located block is that of a concealed effect."""
        return self.answer.location.block in {effect.block for effect in self.truth.effects}

    @property
    def set_reported(self) -> bool:
        """True if the effect and all its rivals are reported as one set."""
        return (
            self.first is not None
            and bool(self.first.reported & self._law(0))
            and all(self.first.reported & {rival, *same_law(rival)} for rival in self.truth.rivals)
        )

    @property
    def resolved(self) -> bool:
        """True if the proposed motion separated the concealed effect from its rivals."""
        if self.later is None or not self.later.named:
            return False
        first = self.later.named[0]
        return first.effect in self._law(0) and not first.reported & (self._laws(0) - self._law(0))

    @property
    def called_untestable(self) -> bool:
        """True if the invisible effect is reported as not testable, and not named."""
        hidden = set(self.truth.not_testable)
        return bool(hidden & set(self.answer.not_testable)) and not any(
            named.effect in hidden for named in self.answer.named
        )

    @property
    def right(self) -> bool:
        """True if the whole answer is right: all concealed effects named and nothing else; below the noise floor also
        nothing named."""
        if self.unanswered:
            return False
        if self.truth.tier == "ambiguous":
            return self.set_reported and not self.spurious
        if self.truth.tier == "insufficient":
            return self.called_untestable and not self.answer.named
        if self.truth.tier == "less_known" and self.called_untestable:
            return not self.answer.named
        if self.truth.tier == "novel" and self.answer.named:
            return all(self.matched) and not self.spurious
        if not self.truth.effects or self.truth.tier == "novel":
            others = (OTHER_VERDICT.get(effect.effect) for effect in self.truth.effects)
            return self.answer.verdict in (self.truth.verdict, *others) and not self.answer.named
        if not self.above_floor and not self.answer.named:
            return True
        return all(self.matched) and not self.spurious

    @property
    def wrong(self) -> str:
        """The error of the answer in words; empty if it is right."""
        if self.right:
            return ""
        if self.unanswered:
            return "There is no diagnosis."
        if self.spurious:
            return f"It names {_listed(named.effect for named in self.spurious)}, which is not there."
        if self.truth.tier == "ambiguous" and self.top:
            return f"It does not report {_listed(self.truth.rivals)} as indistinguishable from what it names."
        if self.truth.tier == "insufficient":
            return f"It does not report {_listed(self.truth.not_testable, 'or')} as not testable."
        unnamed = [effect.effect for effect, found in zip(self.truth.effects, self.matched, strict=True) if not found]
        if self.truth.tier != "novel" and unnamed:
            return f"It does not name {_listed(unnamed)}."
        return f"The verdict is {title(self.answer.verdict)} instead of {title(self.truth.verdict)}."

    def named_right(self, named: Named) -> bool:
        """Return whether a finding names a concealed effect."""
        return any(named is found for found in self.matched)

    def parameter_errors(self) -> dict[str, float]:
        """Return relative errors of the parameters of a right first finding."""
        return {
            name: relative_error(name, value, self._known())
            for name, (value, _) in self._estimated().items()
            if name not in _PLACES
        }

    def covered(self) -> dict[str, bool]:
        """Return whether the 90 % interval of each parameter of a right first finding covers the true value."""
        known = self._known()
        return {
            name: difference(name, value, known[name]) <= NORMAL_90 * deviation
            for name, (value, deviation) in self._estimated().items()
            if name not in names_of(Role.ORDER)
        }

    def nominal_errors(self) -> dict[str, float]:
        """Return relative errors of the corrected parameters of the bench."""
        true = self.truth.true_parameters
        return {name: abs(value / true[name] - 1.0) for name, (value, _) in self.answer.nominal.items() if true[name]}

    def period_error(self) -> float | None:
        """Return the relative error of the spatial period, infinite if none is given; None without a free period."""
        if self.concealed is None or (true := self.concealed.free_period_m) is None:
            return None
        place = self.answer.location
        order = self._said(Role.ORDER) or place.order_per_rev
        return _relative(self.truth.lead_m / order if order else self._said(Role.PERIOD) or place.period_m, true)

    def frequency_error(self) -> float | None:
        """Return the relative error of the frequency of a mode, infinite if none is given; None for other effects."""
        if self.concealed is None or (true := self.concealed.mode_hz) is None:
            return None
        return _relative(self._said(Role.FREQUENCY) or self.answer.location.frequency_hz, true)

    def window_overlap(self) -> float | None:
        """Return intersection over union of the given windows and the true one; None for permanent effects."""
        if self.concealed is None or (true := self.concealed.window_s) is None:
            return None
        edges = self.first.values(Role.EDGE) if self.first else []
        return overlap([edges] if edges else self.answer.location.windows_s, *true)

    def _said(self, role: Role) -> float | None:
        return next(iter(self.first.values(role)), None) if self.first else None

    def _estimated(self) -> dict[str, tuple[float, float]]:
        if not self.top or self.first is None:
            return {}
        return {name: found for name, found in self.first.parameters.items() if name in self._known()}

    def _known(self) -> Mapping[str, float]:
        return self.concealed.compared if self.concealed else {}

    def _law(self, index: int) -> frozenset[str]:
        """Return the ids for the law of a concealed effect, and for another form of it."""
        if index >= len(self.truth.effects):
            return frozenset()
        effect = self.truth.effects[index]
        return frozenset(effect.same_law) | ({OTHER_FORM[effect.effect]} if effect.effect in OTHER_FORM else set())

    def _laws(self, index: int) -> frozenset[str]:
        """Return the same, with the rivals of the first effect."""
        laws = self._law(index)
        return laws.union(*(({rival, *same_law(rival)}) for rival in self.truth.rivals)) if index == 0 else laws


def difference(name: str, value: float, true: float) -> float:
    """Return the absolute error of a parameter; phases [rad] modulo 2 pi."""
    return abs(remainder(value - true, 2.0 * pi)) if name in names_of(Role.PHASE) else abs(value - true)


def relative_error(name: str, value: float, known: Mapping[str, float]) -> float:
    """Return the relative error of a parameter with the true values `known`.

    Amplitudes of harmonics are relative to the first one; the error of a phase [rad] is weighted with its amplitude.
    """
    off = difference(name, value, known[name])
    phases, strengths = ([other for other in known if other in names_of(role)] for role in (Role.PHASE, Role.STRENGTH))
    first = known[strengths[0]] if phases and strengths else 0.0
    if name in phases:
        return off * (known[strengths[phases.index(name)]] / first if first else 1.0)
    scale = first if name in strengths and phases else abs(known[name])
    return off / scale if scale else float(off > 0.0)


def overlap(windows: Iterable[Sequence[float]], begin: float, end: float) -> float:
    """Return intersection over union of windows (begin, end), which may overlap, and the window `begin` to `end`."""
    merged: list[tuple[float, float]] = []
    for a, b in sorted((a, b) for a, b in windows):
        if merged and a <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(merged[-1][1], b)
        else:
            merged.append((a, b))
    common = sum(max(min(b, end) - max(a, begin), 0.0) for a, b in merged)
    return common / (end - begin + sum(b - a for a, b in merged) - common)


def _relative(found: float | None, true: float) -> float:
    return abs(found / true - 1.0) if found else inf


def _listed(names: Iterable[str], last: str = "and") -> str:
    words = [title(name) for name in names]
    return f" {last} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
