"""Import, comparison and friction on the recordings that come with the tests: no file beside the project is needed."""

from __future__ import annotations

import numpy as np
import pytest
from own_recordings import CLEAN, COGGING_LEARN, FOLDER, FOREIGN, FOREIGN_MAP

import hil


def test_the_recordings_are_small() -> None:
    assert sum(path.stat().st_size for path in FOLDER.iterdir() if path.is_file()) < 1_000_000


def test_a_foreign_recording_gives_the_channels_it_was_made_of() -> None:
    clean, imported = hil.read_recording(CLEAN), hil.import_recording(FOREIGN, FOREIGN_MAP)
    rows = slice(0, len(imported))
    assert len(imported) == 1500
    assert imported.period_s == clean.period_s
    np.testing.assert_allclose(imported["position_command_m"], clean["position_command_m"][rows], atol=1e-12)
    np.testing.assert_allclose(imported["table_position_m"], clean["table_position_m"][rows], atol=1e-12)
    np.testing.assert_allclose(imported["motor_position_rad"], clean["motor_position_rad"][rows], atol=3.1e-6)
    np.testing.assert_allclose(imported["velocity_command_m_s"], clean["velocity_command_m_s"][rows], atol=2e-5)
    assert set(imported.metadata["derived"]) == {"velocity_command_m_s", "torque_command_n_m"}


def test_the_twin_explains_the_axis_it_describes() -> None:
    comparison = hil.compare(hil.read_recording(CLEAN), hil.load_bench("reference"))
    assert comparison.explained
    assert comparison.torque.rms == pytest.approx(0.0104, rel=0.05)


def test_the_twin_does_not_explain_a_concealed_cogging_torque_and_the_motor_block_shows_it() -> None:
    comparison = hil.compare(hil.read_recording(COGGING_LEARN), hil.load_bench("reference"))
    assert not comparison.explained
    assert comparison.torque_over_noise > 5.0
    # 0.08 N m of sine is 0.057 N m rms; the loop answers with about as much
    assert 0.04 < comparison.torque.rms < 0.1


def test_friction_follows_from_the_constant_feeds() -> None:
    axis = hil.load_bench("reference").axis
    found = hil.identify_friction(hil.read_recording(CLEAN), settling_s=0.05)
    assert found.coulomb == pytest.approx(axis.coulomb_torque_n_m, rel=0.02)  # type: ignore[union-attr]
