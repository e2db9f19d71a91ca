"""Other methods on the cases of the proof; each answers from the case alone, as the diagnosis does.

    python -m hil.validation.proof.peers CASES OUT [--method NAME]...

Answers are a part of diagnosis.json: the verdict and the ids of the missing effects. All methods get the state of the
diagnosis before its search (`case`), with its refit, periods and windows, and every mechanism of the library as a term
(`regressors`): the comparison is between searches. `..._on_blocks` also get controller and drive as separate equations,
which is an idea of the diagnosis; users of these methods write equations for the plant.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from hil.errors import HilError, InputError
from hil.files.output import write_json
from hil.validation.proof.answer.blind import DIAGNOSIS, ERROR, answered
from hil.validation.proof.peers.case import PeerCase, read_case
from hil.validation.proof.peers.fit_everything import fit_everything
from hil.validation.proof.peers.regressors import BLOCKS
from hil.validation.proof.peers.residual_tests import residual_tests
from hil.validation.proof.peers.sparse_regression import forward_selection, pysindy

METHODS: Mapping[str, Callable[[PeerCase], dict[str, Any]]] = {
    "pysindy": pysindy,
    "pysindy_on_blocks": partial(pysindy, blocks=BLOCKS),
    "forward_selection": forward_selection,
    "forward_selection_on_blocks": partial(forward_selection, blocks=BLOCKS),
    "fit_everything": fit_everything,
    "residual_tests": residual_tests,
}
SLOW = ("fit_everything",)  # minutes per case


def answer_case(case: Path, out: Path, methods: Sequence[str]) -> None:
    """Answer a case with the methods that lack an answer; preparing it once counts as time of each."""
    begin = monotonic()
    todo = [out / name / case.name for name in methods if not answered(out / name / case.name)]
    for answer in todo:
        answer.mkdir(parents=True, exist_ok=True)
    try:
        prepared = read_case(case)
    except Exception as error:
        for answer in todo:
            _fail(answer, error)
        return
    prepared_s = monotonic() - begin
    for answer in todo:
        begin = monotonic()
        try:
            found = METHODS[answer.parent.name](prepared)
        except Exception as error:
            _fail(answer, error)
        else:
            write_json(answer / DIAGNOSIS, found | {"runtime_s": prepared_s + monotonic() - begin})


def _fail(answer: Path, error: Exception) -> None:
    """Write a failure as a wrong answer; raise it if the method is not installed."""
    if isinstance(error, HilError) and not isinstance(error, InputError):
        raise error
    write_json(answer / ERROR, {"kind": type(error).__name__, "error": str(error)})
