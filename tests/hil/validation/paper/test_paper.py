"""The reproduction of the source: every row of the reading notes, figures that are pictures, moves as described."""

import json

import matplotlib.image
import numpy as np
import pytest

from hil.twin.structure.chain import RECONSTRUCTED_TABLE_1, one_mass
from hil.validation.paper import PaperResult, Reproduction, run_paper, source
from hil.validation.paper.row import Row


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> PaperResult:
    return run_paper(tmp_path_factory.mktemp("paper") / "made" / "on the way")


def row(result: PaperResult, where: str, quantity: str = "") -> Row:
    (found,) = [r for r in result.rows if r.where == where and quantity in r.quantity]
    return found


def test_eq_20_and_22_are_reproduced(result: PaperResult) -> None:
    rows = [r for r in result.rows if r.where in ("Eq. 20", "Eq. 22")]
    assert len(rows) == 8
    assert {r.verdict for r in rows} == {Reproduction.REPRODUCED}


@pytest.mark.parametrize(
    ("where", "quantity", "printed", "computed"),
    [
        ("Eq. 1, 7, 8", "decay", 0.0, 0.03 * 2 * np.pi * 89.36),
        ("Eq. 5", "", -2 * np.sqrt(335 * 384) / 719, 0.0),
        ("Eq. 6", "", 335 / 719, 1 / 719),
        ("Sec. 3.2.2", "", 87.0, 89.4),
        ("Eq. 23", "series", 5.64e7, 4.37e7),
        ("Sec. 3.3.1, Eq. 24", "22 m/min", 1.02, 2.57),
        ("Sec. 3.3.2", "without feed-forward, 2-dof", 2.32, 6.55),
    ],
)
def test_what_does_not_hold_as_printed_is_said_with_both_values_and_a_reason(
    result: PaperResult, where: str, quantity: str, printed: float, computed: float
) -> None:
    found = row(result, where, quantity)
    assert found.verdict is Reproduction.DIFFERS
    assert found.printed == pytest.approx(printed, rel=0.005, abs=1e-9)
    assert found.computed == pytest.approx(computed, rel=0.005, abs=1e-9)
    assert found.why


def test_the_misprints_of_the_appendix_matter(result: PaperResult) -> None:
    sign, damper = row(result, "Appendix, TF_4-5"), row(result, "Appendix, TF_3-4")
    assert sign.computed == pytest.approx(1.0, abs=1e-3)  # at 1 Hz the table follows the motor
    assert sign.printed > 2.0
    assert damper.computed > 1.0


def test_both_forms_of_eq_23_and_of_the_friction_torque_stand_in_the_table(result: PaperResult) -> None:
    assert row(result, "Eq. 23", "parallel").verdict is Reproduction.REPRODUCED
    assert row(result, "Sec. 3.3.1, Eq. 24", "7 m/min").verdict is Reproduction.REPRODUCED
    assert row(result, "Eq. 16, 17").computed < 1e-9
    assert row(result, "Appendix").computed < 1e-9


def test_every_difference_has_a_reason_and_what_has_no_number_claims_none(result: PaperResult) -> None:
    for r in result.rows:
        if r.verdict is Reproduction.DIFFERS:
            assert r.why, r.quantity
        if r.verdict is Reproduction.NOT_COMPARABLE:
            assert r.printed is None or r.computed is None


@pytest.mark.parametrize("printed", [100.0, -100.0, 0.0])
def test_the_verdict_follows_the_tolerance(printed: float) -> None:
    allowed = 0.01 * (abs(printed) or 1.0)
    inside, outside = (Row("", "", "", printed, printed + share * allowed, 0.01, "") for share in (0.99, 1.01))
    assert inside.verdict is Reproduction.REPRODUCED
    assert outside.verdict is Reproduction.DIFFERS


def test_the_folder_holds_the_pictures_and_the_numbers(result: PaperResult) -> None:
    written = json.loads((result.folder / "paper.json").read_text(encoding="utf-8"))
    assert {picture.figure for picture in result.pictures} >= {
        "Fig. 6",
        "Fig. 7",
        "Fig. 8",
        "Fig. 9a",
        "Fig. 9b",
        "Fig. 9c",
        "Fig. 10",
    }
    for picture in result.pictures:
        pixels = matplotlib.image.imread(result.folder / picture.file)
        assert min(pixels.shape[:2]) > 500
        assert pixels[..., :3].std() > 0.05  # not an empty page
    assert len(written["rows"]) == len(result.rows)
    assert {r["verdict"] for r in written["rows"]} == {verdict.value for verdict in Reproduction}
    assert any("reconstruction" in text for text in written["assumptions"])
    np.testing.assert_allclose(written["seven_dof"]["modal_matrix"], result.modal_matrix)
    inertias, _ = RECONSTRUCTED_TABLE_1.reduced()
    phi = np.array(written["seven_dof"]["modal_matrix"])
    np.testing.assert_allclose(phi.T @ np.diag(inertias) @ phi, np.eye(7), atol=1e-9)


def test_at_22_m_min_there_is_hardly_any_constant_feed_and_30_is_lowered_and_said_so() -> None:
    chain = source.chains()["2-dof"]
    moves = {feed: source.simulate(chain, feed).command for feed in source.FEEDS_M_MIN}
    constant = {
        feed: np.mean((move.acceleration_m_s2 == 0.0)[move.velocity_m_s != 0.0]) for feed, move in moves.items()
    }
    assert constant[7.0] > 0.8
    assert 0.0 < constant[22.0] < 0.1
    assert not moves[22.0].notes
    assert "feed lowered from 0.5 m/s" in moves[30.0].notes[0]


def test_a_simulated_move_arrives_holds_its_friction_torque_and_is_the_integral_of_its_jerk() -> None:
    run = source.simulate(source.chains()["7-dof"], 7.0)
    assert run.table.position_m[-1] == pytest.approx(0.100, abs=2e-6)
    middle = np.abs(run.command.position_m - 0.05) < 0.03
    assert np.mean(run.response.torque[middle]) == pytest.approx(1.1 + 0.0064 * 7 / 60 / source.RATIO_M_RAD, rel=1e-3)
    period_s = run.command.period_s
    assert np.sum(run.table.jerk_m_s3) * period_s == pytest.approx(0.0, abs=0.01)
    np.testing.assert_allclose(np.cumsum(run.command.velocity_m_s)[-1] * period_s, 0.100, rtol=1e-3)


def test_a_rigid_axis_follows_newton() -> None:
    """Independent of modes: torque = J theta'' + friction where the axis moves without vibration."""
    chain = one_mass(719.0, source.LEAD_M)
    run = source.simulate(chain, 7.0)
    r = source.RATIO_M_RAD
    speed = np.gradient(run.response.motor_position, run.command.period_s)
    moving = slice(60, 900)
    work = np.sum(run.response.torque[moving] * speed[moving]) * run.command.period_s
    kinetic = 0.5 * 719.0 * r**2 * (speed[900] ** 2 - speed[60] ** 2)
    friction = np.sum((1.1 + 0.0064 * speed[moving]) * speed[moving]) * run.command.period_s
    assert work == pytest.approx(kinetic + friction, rel=0.01)
