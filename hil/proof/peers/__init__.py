"""Other methods on the cases of the proof; each answers from the case alone, as the diagnosis does.

    python -m hil.proof.peers CASES OUT [--method NAME]...

Answers are a part of diagnosis.json: the verdict and the ids of the missing effects. All methods get the state of the
diagnosis before its search (`case`), with its refit, periods and windows, and every mechanism of the library as a term
(`regressors`): the comparison is between searches. `..._on_blocks` also get controller and drive as separate equations,
which is an idea of the diagnosis; users of these methods write equations for the plant.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from hil.proof.peers.case import PeerCase
from hil.proof.peers.fit_everything import fit_everything
from hil.proof.peers.regressors import BLOCKS
from hil.proof.peers.residual_tests import residual_tests
from hil.proof.peers.sparse_regression import forward_selection, pysindy

METHODS: Mapping[str, Callable[[PeerCase], dict[str, Any]]] = {
    "pysindy": pysindy,
    "pysindy_on_blocks": partial(pysindy, blocks=BLOCKS),
    "forward_selection": forward_selection,
    "forward_selection_on_blocks": partial(forward_selection, blocks=BLOCKS),
    "fit_everything": fit_everything,
    "residual_tests": residual_tests,
}
SLOW = ("fit_everything",)  # minutes per case
