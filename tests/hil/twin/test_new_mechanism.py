"""A mechanism is one file and one line: one that the library does not know is added by a call, and diagnosed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SUPPORT = Path(__file__).parents[2] / "support"

# The one file: physics, text and bounds, and nothing else.
MECHANISM = """
from numba import njit

from hil.twin.mechanism import Block, Mechanism, Stage, Text, Variant
from hil.twin.parameter import Dimension, Parameter, Role


@njit
def _bowl(value, at, parameters, memory):
    return value - parameters[0] * (at.table_position_m / 0.05) ** 2


MECHANISM = Mechanism(
    id="quadratic_load",
    block=Block.MOTOR_SIDE,
    element="bent guideway",
    equation="T = u - T_50 (x / 50 mm)^2",
    source="made up for this test",
    parameters=(Parameter("bowl_n_m", Dimension.TORQUE, -10.0, 10.0, role=Role.STRENGTH),),
    variants=(Variant(Stage.MOTOR_TORQUE, _bowl),),
    text=Text("A load rises with the square of the position, to {bowl_n_m} at 50 mm."),
)
"""

# The one line is the first that follows the imports.
REGISTER = """
from hil.twin import library
import quadratic_load
library.register(quadratic_load.MECHANISM)
"""

PRELUDE = """
from diagnosis_runs import bench, dataset, fitted, recorded
from hil.identification.terms import Term
owner, truth = bench(), Term("quadratic_load", 0, (0.4,))
"""

MOTION = """
import numpy as np
from hil.control.cascade import make_gains
from hil.twin.axis import Start, Twin
from hil.twin.physics import Active, Physics
from hil.twin.structure.chain import one_mass
law = make_gains(position_gain_1_s=30.0, velocity_gain_n_m_s_rad=0.5, ratio_m_rad=1.0)
twin = Twin(Physics(one_mass(1.0), 0.0, 0.0), law, (Active("quadratic_load", (0.4,)),))
held, let_go = (twin.drive(np.full(11, force), Start(0.05)).motor_position for force in (0.4, 0.0))
print(np.ptp(held), let_go[-1] - 0.05)
"""

SCREEN = """
from hil.diagnosis.search.score_test import screen_library
from hil.identification.measured import take
from hil.identification.hypothesis import Hypothesis
data = dataset([take(recorded(owner, truth), owner)], owner)
print(screen_library(fitted(Hypothesis(owner), data, evaluations=8))[0].term.effect)
"""

DIAGNOSIS = """
from hil.diagnosis.diagnose import diagnose
found = diagnose([recorded(owner, truth)], [recorded(owner, truth, seed=2)], owner).result
print(found.missing[0].effect, round(found.missing[0].parameters["bowl_n_m"].value, 2), found.missing[0].sentence)
"""


def printed(folder, script):
    """The last line that a script prints in a process of its own, where cached kernels of the library must not do."""
    (folder / "quadratic_load.py").write_text(MECHANISM)
    path = os.pathsep.join([str(folder), str(SUPPORT), *sys.path])
    environment = os.environ | {"PYTHONPATH": path}
    command = [sys.executable, "-c", REGISTER + script]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


@pytest.mark.long
def test_it_acts_on_the_axis(tmp_path) -> None:
    """At 50 mm the load is 0.4 N: an equal force holds 1 kg there, and without one it falls by a t^2 / 2 in 10 ms."""
    ripple, fallen = map(float, printed(tmp_path, MOTION).split())
    assert ripple < 1e-12
    assert fallen == pytest.approx(-0.5 * 0.4 * 0.01**2, rel=1e-3)


@pytest.mark.long
def test_the_screen_puts_it_first(tmp_path) -> None:
    assert printed(tmp_path, PRELUDE + SCREEN) == "quadratic_load"


@pytest.mark.long
def test_the_diagnosis_names_it_first_with_its_strength(tmp_path) -> None:
    effect, strength, sentence = printed(tmp_path, PRELUDE + DIAGNOSIS).split(" ", 2)
    assert effect == "quadratic_load"
    assert float(strength) == pytest.approx(0.4, rel=0.03)
    assert sentence.startswith("A load rises with the square of the position, to 0.4")
