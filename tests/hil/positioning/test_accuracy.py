"""ISO 230-2: a published table, the formulas as plain loops, recordings and readings, and an axis before and after."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import mean, stdev

import numpy as np
import pytest
from browser import CHROMIUM, NO_CHROMIUM, browser
from command_line import hil as command
from command_line import refused
from published_table import (
    BACKWARD_MM,
    ESTIMATOR_MM,
    FIGURES_MM,
    FORWARD_MM,
    MEAN_MM,
    REPEATABILITY_MM,
    REVERSAL_MM,
    TARGET_MM,
)

import hil
from hil.bench.bench_file import Bench, load_bench
from hil.compensating.compensate import plan_compensation, section_of
from hil.errors import InputError
from hil.positioning.accuracy import FIGURES, PositioningAccuracy
from hil.positioning.approaches import Approaches
from hil.recording.recording import Recording, write_parquet

DIGIT_MM = 0.51e-8  # last digit of the published report
PERIOD_S = 0.002


def readings(path: Path, unit: str = "mm", factor: float = 1.0, header: str = "reading") -> Path:
    """The published readings as a laser writes them, in the order of the standard's cycle."""
    lines = [f"target_{unit},{header}_{unit}"]
    for cycle in range(5):
        for order, table in ((range(5), FORWARD_MM), (range(4, -1, -1), BACKWARD_MM)):
            lines += [f"{factor * TARGET_MM[i]:.10f},{factor * table[i][cycle]:.10f}" for i in order]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_published_table_gives_the_published_figures(tmp_path: Path) -> None:
    found = hil.positioning_accuracy(readings(tmp_path / "laser.csv"))
    np.testing.assert_allclose(1e3 * found.target_m, TARGET_MM)
    for values, published in (
        (found.mean_m, MEAN_MM),
        (found.estimator_m, ESTIMATOR_MM),
        (found.reversal_at_m, REVERSAL_MM),
        (found.repeatability_at_m, REPEATABILITY_MM),
    ):
        np.testing.assert_allclose(1e3 * values, published, rtol=0, atol=DIGIT_MM)
    assert {name: 1e3 * found.figures[name] for name in FIGURES_MM} == pytest.approx(FIGURES_MM, abs=DIGIT_MM)
    assert found.notes == (
        "the targets are equally spaced: a periodic error of that pitch, or a part of it, is not seen",
    )


def by_loops(forward: list[list[float]], backward: list[list[float]]) -> dict[str, float]:
    """The standard's formulas, one after the other, of deviations [target][cycle]."""
    found = {}
    ways = {"forward": forward, "backward": backward}
    means = {way: [mean(row) for row in rows] for way, rows in ways.items()}
    spread = {way: [stdev(row) for row in rows] for way, rows in ways.items()}
    highest, lowest, every = [], [], []
    for way in ways:
        upper = [x + 2 * s for x, s in zip(means[way], spread[way], strict=True)]
        lower = [x - 2 * s for x, s in zip(means[way], spread[way], strict=True)]
        highest, lowest, every = highest + upper, lowest + lower, every + means[way]
        found[f"accuracy_{way}_m"] = max(upper) - min(lower)
        found[f"systematic_{way}_m"] = max(means[way]) - min(means[way])
        found[f"repeatability_{way}_m"] = max(4 * s for s in spread[way])
    reversals = [up - down for up, down in zip(means["forward"], means["backward"], strict=True)]
    found["reversal_m"] = max(abs(one) for one in reversals)
    found["mean_reversal_m"] = mean(reversals)
    found["repeatability_m"] = max(
        max(2 * up + 2 * down + abs(b), 4 * up, 4 * down)
        for up, down, b in zip(spread["forward"], spread["backward"], reversals, strict=True)
    )
    middle = [(up + down) / 2 for up, down in zip(means["forward"], means["backward"], strict=True)]
    found["mean_range_m"] = max(middle) - min(middle)
    found["systematic_m"] = max(every) - min(every)
    found["accuracy_m"] = max(highest) - min(lowest)
    return found


@pytest.mark.parametrize("seed", range(4))
def test_every_figure_is_that_of_the_formulas(seed: int) -> None:
    rng = np.random.default_rng(seed)
    forward, backward = rng.normal(scale=3e-6, size=(2, 5, 5)) + rng.normal(scale=5e-6, size=(2, 5, 1))
    found = PositioningAccuracy(Approaches("x", "m", np.arange(5) * 0.1, forward, backward))
    expected = by_loops(forward.tolist(), backward.tolist())
    assert set(expected) == set(FIGURES)
    assert dict(found.figures) == pytest.approx(expected, rel=1e-9)


def test_readings_may_be_deviations_in_another_unit_with_their_direction(tmp_path: Path) -> None:
    whole = hil.positioning_accuracy(readings(tmp_path / "mm.csv"))
    inches = hil.positioning_accuracy(readings(tmp_path / "in.csv", "in", 1 / 25.4))
    assert dict(inches.figures) == pytest.approx(dict(whole.figures), rel=1e-4)
    lines = ["direction,target_mm,deviation_um"]
    for way, table in ((1, FORWARD_MM), (-1, BACKWARD_MM)):  # all forward, then all backward: told by the column
        for target, row in zip(TARGET_MM, table, strict=True):
            lines += [f"{way},{target},{1e3 * (value - target):.9f}" for value in row]
    (tmp_path / "told.csv").write_text("\n".join(lines) + "\n")
    told = hil.positioning_accuracy(tmp_path / "told.csv")
    assert dict(told.figures) == pytest.approx(dict(whole.figures), rel=1e-6)


def run_of(targets_m: list[float], cycles: int, errors_m: dict[int, float]) -> Recording:
    """A recording that goes beyond both ends and rests at each target, with an error of each direction and a slope."""
    end_m = targets_m[-1] + 0.01
    command, table, place = [0.0] * 200, [0.0] * 200, 0.0
    for _ in range(cycles):
        for way, order in ((1, targets_m), (-1, targets_m[::-1])):
            turn = [] if way == 1 else [end_m]
            for target in [*turn, *order, *([0.0] if way == -1 else [])]:
                moved = np.linspace(place, target, 50)[1:].tolist()
                rest = [target] * 150 if target in targets_m else []
                command += moved + rest
                table += moved + [target + errors_m[way] + 1e-4 * target] * len(rest)
                place = target
    columns = {
        "time_s": np.arange(len(command)) * PERIOD_S,
        "position_command_m": np.array(command),
        "table_position_m": np.array(table),
    }
    return Recording("made", columns, PERIOD_S)


def test_standstills_of_a_recording_are_the_deviations() -> None:
    targets = [0.013, 0.055, 0.081, 0.122, 0.164]
    found = hil.positioning_accuracy(run_of(targets, 5, {1: -4e-6, -1: 3e-6}))
    np.testing.assert_allclose(found.target_m, targets)
    assert found.deviations.forward_m.shape == (5, 5)
    np.testing.assert_allclose(found.mean_m[0], -4e-6 + 1e-4 * np.array(targets), atol=1e-15)
    assert found.figures["mean_reversal_m"] == pytest.approx(-7e-6)
    assert found.figures["systematic_m"] == pytest.approx(7e-6 + 1e-4 * (0.164 - 0.013))
    assert found.notes == ()
    few = hil.positioning_accuracy(run_of([0.02, 0.05, 0.08], 2, {1: 0.0, -1: 0.0}))
    assert [note.split(";")[0].split(":")[0] for note in few.notes] == [
        "3 targets and 2 cycles",
        "the targets are equally spaced",
    ]


def test_without_approaches_from_both_sides_it_is_refused() -> None:
    with pytest.raises(InputError, match=r"profiles/positioning_iso_230_2\.yaml"):
        hil.positioning_accuracy(run_of([0.02, 0.05], 1, {1: 0.0, -1: 0.0}))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("target_mm,reading\n1,2\n", "target_mm and reading_mm"),
        ("target_mm,reading_rad\n1,2\n", "target_mm and reading_mm"),
        ("target_mm,reading_mm\n1,1\n1,1\n", "direction"),
        ("target_mm,reading_mm,direction\n1,1,0\n2,1,1\n", "direction"),
    ],
)
def test_readings_that_are_not_told_are_refused(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "laser.csv").write_text(text)
    assert told in refused(tmp_path, "iso230", "laser.csv")


def test_the_shipped_profile_is_a_cycle_of_the_standard() -> None:
    bench = load_bench("reference")
    motion = hil.plan(hil.load_profile("positioning_iso_230_2"), bench.period_s)
    assert motion.notes == ()
    columns = {"position_command_m": motion.position_m, "table_position_m": motion.position_m, "time_s": motion.time_s}
    found = hil.positioning_accuracy(Recording("ideal", columns, bench.period_s))
    assert found.target_m.size >= 5
    assert found.deviations.forward_m.shape[1] == 5
    assert found.notes == ()  # neither too few nor equally spaced
    turn = 2.0 * np.pi * found.target_m / 0.010  # of the screw: its periodic error is seen at many phases
    assert abs(np.exp(1j * turn).mean()) < 0.3


def test_the_command_writes_a_page_of_several_runs(tmp_path: Path) -> None:
    targets = [0.013, 0.055, 0.081, 0.122, 0.164]
    for name, size in (("before", 6e-6), ("after", 1e-6)):
        run = run_of(targets, 5, {1: -size, -1: size})
        still = {one: np.zeros(len(run)) for one in ("motor_position_rad", "torque_n_m", "torque_command_n_m")}
        write_parquet(Recording(name, run.columns | still, run.period_s), tmp_path / f"{name}.parquet")
    ran = command(tmp_path, "iso230", "before.parquet", "after.parquet", "--out", "judged")
    assert ran.returncode == 0, ran.stderr
    rows = {line.split()[0]: line for line in ran.stdout.splitlines() if line.strip()}
    assert rows["B"].split()[-4:] == ["12.0", "µm", "2.00", "µm"]
    runs = json.loads((tmp_path / "judged" / "iso230.json").read_text())["runs"]
    assert [one["figures"]["reversal_m"] for one in runs] == pytest.approx([12e-6, 2e-6])
    assert "neither or both" in refused(tmp_path, "iso230")
    if CHROMIUM is None:
        pytest.skip(NO_CHROMIUM)
    with browser(tmp_path / "browser", f"file://{tmp_path}/judged/iso230.html") as page:
        for width, dark in ((1000, False), (390, True)):
            page.size(width, 900, dark)
            assert page.run("document.documentElement.scrollWidth") <= width
        page.until("document.images.length > 0 && [...document.images].every(one => one.naturalWidth > 600)")
        assert "repeatability R" in page.run("document.body.innerText")
        assert page.errors == []


@pytest.mark.long
def test_a_compensation_of_lead_error_and_play_is_seen_in_the_figures(capsys: pytest.CaptureFixture[str]) -> None:
    data = load_bench("reference").model_dump(mode="json")
    entries = [
        {"effect": "periodic_lead_error", "parameters": {"amplitude_m": 8e-6, "phase_rad": 0.5}},
        {"effect": "backlash", "parameters": {"gap_m": 12e-6}},
        {"effect": "table_side_friction", "parameters": {"share": 0.3}},
    ]
    plain = Bench.model_validate(data | {"simulation": {"effects": entries}})
    diagnosed = Bench.model_validate(plain.model_dump(mode="json") | {"mechanisms": entries})
    motion = hil.plan(hil.load_profile("positioning_iso_230_2"), plain.period_s)
    section = section_of(plan_compensation(diagnosed, motion, None, 0.3), Path("bench.yaml"), "2026-01-31")
    compensated = Bench.model_validate(plain.model_dump(mode="json") | {"compensation": section})
    before, after = (
        hil.positioning_accuracy(hil.simulate(one, motion, seed=4)).figures for one in (plain, compensated)
    )
    with capsys.disabled():
        for name, (symbol, _) in FIGURES.items():
            print(f"\n{symbol:3} {1e6 * before[name]:8.2f} -> {1e6 * after[name]:6.2f} µm", end="")
    assert before["accuracy_m"] > 25e-6
    for name in ("accuracy_m", "systematic_m", "reversal_m"):
        assert after[name] < 0.15 * before[name]
