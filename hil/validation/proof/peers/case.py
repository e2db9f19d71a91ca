"""Input of the other methods for a case, and the form of their answers.

All methods get the state of the diagnosis before its search: recordings on one clock with their noise, the nominal
parameters refitted in the twin, and orders, periods, window and levels estimated from the residuals of that refit.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.preparation.preflight import preflight
from hil.diagnosis.result import Verdict
from hil.diagnosis.search.initial_values import scene
from hil.diagnosis.verdict.judge import refit_matters
from hil.identification.dataset import prepare_dataset
from hil.identification.estimator import Fit
from hil.identification.measured import Measured
from hil.identification.nominal_fit import fit_nominal_parameters
from hil.recording.recording import read_recording
from hil.twin.scene import Scene

_TRAIN, _HELD_OUT = ("train_1", "train_2"), ("holdout",)


@dataclass(frozen=True, eq=False)
class PeerCase:
    """A prepared case: `owner` and `nominal` are the twin with the parameters of the bench file and with refitted ones,
    `scene` holds the estimates from the residuals of the latter."""

    bench: Bench
    train: tuple[Measured, ...]
    held_out: tuple[Measured, ...]
    owner: Fit
    nominal: Fit
    scene: Scene

    def answer(self, effects: Sequence[str]) -> dict[str, Any]:
        """Return the verdict and the named effects, the most important one first, in the form of diagnosis.json.

        Without effects, the verdict on the parameters of the bench is that of the diagnosis.
        """
        if effects:
            verdict = Verdict.MISSING_PHYSICS
        else:
            wrong = refit_matters(self.owner, self.nominal)
            verdict = Verdict.PARAMETER_ERROR if wrong else Verdict.NO_MISMATCH
        return {"verdict": str(verdict), "missing": [{"effect": effect} for effect in effects]}


def read_case(folder: Path) -> PeerCase:
    """Read a case folder and refit the nominal parameters. Raises InputError as the diagnosis does."""
    bench = load_bench(folder / "bench.yaml")
    names = (*_TRAIN, *_HELD_OUT)
    runs = preflight([read_recording(folder / f"{name}.parquet") for name in names], bench).accepted()
    train, held_out = tuple(runs[: len(_TRAIN)]), tuple(runs[len(_TRAIN) :])
    nominal = fit_nominal_parameters(prepare_dataset(train, bench))
    return PeerCase(
        bench,
        train,
        held_out,
        nominal.estimator.evaluate(nominal.hypothesis.given),
        nominal,
        scene(train, nominal.bench, nominal.residuals.channels, nominal.data.observer_s),
    )
