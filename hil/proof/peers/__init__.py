"""Other methods on the cases of the proof; each answers from the case alone, as the diagnosis does.

    python -m hil.proof.peers CASES OUT [--method NAME]...

Answers have the form of diagnosis.json as far as a method can tell: the verdict, and the ids of what is missing. All
get what the diagnosis has before it searches (`case`) and every mechanism of the library as a term (`regressors`): what
is compared is the search. `..._on_blocks` also get the controller and the drive as equations of their own; others write
equations for the plant, to cut the chain there is an idea of the diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from hil.proof.peers.case import Answer, Case
from hil.proof.peers.fit_everything import fit_everything
from hil.proof.peers.forward_selection import forward_selection
from hil.proof.peers.pysindy_peer import pysindy
from hil.proof.peers.regressors import BLOCKS
from hil.proof.peers.residual_tests import residual_tests

METHODS: Mapping[str, Callable[[Case], Answer]] = {
    "pysindy": pysindy,
    "pysindy_on_blocks": partial(pysindy, blocks=BLOCKS),
    "forward_selection": forward_selection,
    "forward_selection_on_blocks": partial(forward_selection, blocks=BLOCKS),
    "fit_everything": fit_everything,
    "residual_tests": residual_tests,
}
SLOW = ("fit_everything",)  # minutes a case
