"""What every other method is given of a case, and the form of its answer.

All get what the diagnosis has before it searches: recordings on one clock with their noise, the nominal parameters
refitted in the twin, and the orders, periods, window and levels that stand out of what the refit leaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.preflight import prepare
from hil.diagnosis.result import Verdict
from hil.diagnosis.search.initial_values import scene
from hil.diagnosis.verdict.judge import refit_matters
from hil.identification.dataset import Measured, prepare_dataset
from hil.identification.estimator import Fit
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.recording.recording import read_recording
from hil.twin.scene import Scene

Answer = dict[str, Any]
_TRAIN, _HELD_OUT = ("train_1", "train_2"), ("holdout",)


@dataclass(frozen=True, eq=False)
class Case:
    """A case folder ready for a method: `owner` and `nominal` are the twin as believed and refitted, `scene` holds
    what stands out of the latter's residuals."""

    bench: Bench
    train: tuple[Measured, ...]
    held_out: tuple[Measured, ...]
    owner: Fit
    nominal: Fit
    scene: Scene

    @property
    def fitted(self) -> Bench:
        """The bench with the refitted nominal parameters."""
        return self.nominal.bench

    def answer(self, effects: Sequence[str]) -> Answer:
        """diagnosis.json as far as a method can tell: the effects it names, the most important one first.

        Without any, whether the parameters of the bench are wrong is judged as the diagnosis does.
        """
        if effects:
            verdict = Verdict.MISSING_PHYSICS
        else:
            wrong = refit_matters(self.owner, self.nominal)
            verdict = Verdict.PARAMETER_ERROR if wrong else Verdict.NO_MISMATCH
        return {"verdict": str(verdict), "missing": [{"effect": effect} for effect in effects]}


def read_case(folder: Path) -> Case:
    """Read a case folder and refit the nominal parameters. Raises InputError as the diagnosis does."""
    bench = load_bench(folder / "bench.yaml")
    names = (*_TRAIN, *_HELD_OUT)
    runs = prepare([read_recording(folder / f"{name}.parquet") for name in names], bench)
    train, held_out = tuple(runs[: len(_TRAIN)]), tuple(runs[len(_TRAIN) :])
    nominal = fit_nominal_parameters(prepare_dataset(train, bench))
    return Case(
        bench,
        train,
        held_out,
        nominal.estimator.evaluate(nominal.hypothesis.owner),
        nominal,
        scene(train, nominal.bench, nominal.residuals.channels, nominal.data.observer_s),
    )
