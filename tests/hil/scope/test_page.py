"""The page in a real browser, beside `hil run` on a simulated bench in wall-clock time."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from browser import CHROMIUM, NO_CHROMIUM, Page, browser
from compare_runs import THERE_AND_BACK, bench_with, record
from patient_bench import patient_bench_file
from processes import DEADLINE_S
from scope_process import scope

from hil.recording.recording import read_recording

LIMITS = {"velocity_m_s": 0.3, "acceleration_m_s2": 2.2, "jerk_m_s3": 100.0}
NEWEST = "scope.store.rows[0].at(-1)"


class BenchRuns:
    """`hil run` on a simulated bench, for longer than a test."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.bench = folder, patient_bench_file(folder)
        self.start("first")

    def start(self, name: str) -> None:
        """Start a run with this name."""
        segments = [{"kind": "repeat", "times": 100, "segments": THERE_AND_BACK}]
        profile = self.folder / f"{name}.yaml"
        profile.write_text(yaml.safe_dump({"schema_version": 1, "limits": LIMITS, "segments": segments}))
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hil.cli", "run", profile.name, "--bench", str(self.bench), "--force"],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def kill(self) -> None:
        """End it without a word; its recorder saves what is in memory."""
        self.process.kill()
        self.process.wait(DEADLINE_S)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("page")


@pytest.fixture(scope="module")
def bench(folder: Path) -> Iterator[BenchRuns]:
    if CHROMIUM is None:
        pytest.skip(NO_CHROMIUM)
    runs = BenchRuns(folder)
    yield runs
    runs.kill()


@pytest.fixture(scope="module")
def page(folder: Path, bench: BenchRuns) -> Iterator[Page]:
    """The page of a scope beside a run that goes on."""
    with scope(folder, "--within", ".", "--out", "saved") as address, browser(folder / "profile", address) as opened:
        opened.size(1400, 1000)
        opened.until("window.scope && scope.mode === 'rolling' && scope.store.rows[0].length > 50", DEADLINE_S)
        yield opened


def centre(page: Page, panel: str, share: float = 0.5) -> tuple[float, float]:
    """A point of a plot, at a share of its width."""
    box = page.run(f"(({{x, y, width, height}}) => [x, y, width, height])"
                   f"(document.querySelector('[data-panel=\"{panel}\"] .u-over').getBoundingClientRect())")  # fmt: skip
    return box[0] + share * box[2], box[1] + 0.5 * box[3]


def rolls(page: Page) -> None:
    """Let the page roll again."""
    page.run("scope.send({do: 'hold', on: false})")
    page.until("scope.mode === 'rolling'")


def test_curves_of_command_measurement_and_twin_move(page: Page) -> None:
    page.until("scope.mode === 'rolling'")
    before = page.run(NEWEST)
    pixels = "document.querySelector('[data-panel=position] canvas').toDataURL()"
    page.until(f"{NEWEST} > {before} + 0.3")
    page.run(f"window.before = {pixels}")
    page.until(f"{pixels} !== window.before")
    shown = set(page.run("scope.shown.map(trace => trace.name)"))
    assert {"position_command_m", "table_position_m", "twin_table_position_m", "residual_torque"} <= shown
    panels = page.run("scope.panels.all.map(panel => [panel.name, panel.unit.name])")
    assert ["position", "mm"] in panels
    assert ["torque", "N m"] in panels
    assert not page.errors


def test_readings_tell_state_and_numbers_in_words(page: Page) -> None:
    page.until("document.getElementById('state').textContent === 'operation enabled'")
    page.until("/position.*mm.*following error.*m.*torque.*N m.*late.*bus.*%.*done.*%/.test("
               "document.getElementById('readings').textContent)")  # fmt: skip


def test_keys_stand_outside_of_the_data(page: Page) -> None:
    assert page.run("""scope.panels.all.every(panel => {
        const low = panel.plot.over.getBoundingClientRect().top + 1;
        return [...panel.element.querySelectorAll('p, p *')].every(key => key.getBoundingClientRect().bottom <= low);
    })""")


def test_hold_stops_the_picture_and_run_lets_it_go_on(page: Page) -> None:
    page.click("#hold")
    page.until("scope.mode === 'held' && scope.store.still")
    held = page.run(NEWEST)
    page.run("new Promise(done => setTimeout(done, 300))")
    assert page.run(NEWEST) == held
    page.click("#hold")
    page.until(f"scope.mode === 'rolling' && !scope.store.still && {NEWEST} > {held}")


def test_a_stretch_that_is_dragged_is_shown_with_every_row(page: Page) -> None:
    page.click("#hold")
    page.until("scope.store.still")
    span = "scope.store.range[1] - scope.store.range[0]"
    before = page.run(span)
    page.drag(centre(page, "torque", 0.7), centre(page, "torque", 0.8))
    page.until(f"{span} < {0.2 * before}")
    steps_s = np.diff(page.run("[...scope.store.rows[0]]"))
    assert np.median(steps_s) == pytest.approx(0.001)  # a busy machine leaves out some
    rolls(page)


def test_cursors_give_differences_and_statistics_between_them(page: Page) -> None:
    page.click("#cursors")
    page.until(
        "scope.cursors.on && scope.store.still && document.getElementById('between').textContent.startsWith('A ')"
    )
    before = page.run("scope.cursors.at[0]")
    share = page.run("(scope.cursors.at[0] - scope.store.range[0]) / (scope.store.range[1] - scope.store.range[0])")
    page.drag(centre(page, "position", share), centre(page, "position", 0.2))
    page.until(f"scope.cursors.at[0] < {before}")
    rows = "[...document.querySelectorAll('[data-trace=position_command_m]')]"
    cells = f"{rows}.map(row => [...row.cells].map(cell => cell.textContent))"
    page.until(f"{cells}.length === 2")
    values, statistics = page.run(cells)
    a, b, difference = (float(text.replace("−", "-")) for text in values[2:])
    assert difference == pytest.approx(b - a, abs=0.011)
    assert len(statistics) == 8
    page.click("#cursors")
    rolls(page)


def test_a_single_shot_stands_at_its_level(page: Page) -> None:
    page.run("""(() => {
        document.getElementById('window').value = '0.5';
        document.getElementById('window').onchange();
        document.getElementById('source').value = 'table_position_m';
        document.getElementById('source').onchange();
        document.getElementById('level').value = '20';
        document.getElementById('level').oninput();
    })()""")
    page.click("#single")
    page.until("scope.mode === 'waiting'")
    page.until("scope.store.still && scope.store.zero > 0 && scope.mode === 'held'")
    assert page.run("scope.store.rows[0].length") == 501
    at = page.run("scope.store.rows[0].findIndex(time => time >= scope.store.zero)")
    assert at == 100
    row = "scope.store.rows[1 + scope.store.names.indexOf('table_position_m')]"
    before, after = page.run(f"[{row}[{at} - 1], {row}[{at}]]")
    assert before < 0.020 <= after
    assert page.run("scope.panels.all[0].plot.axes[0].label") in (None, "time from the trigger [s]")


def test_what_is_seen_is_saved(page: Page, folder: Path) -> None:
    page.run("document.getElementById('saveName').value = 'seen'")
    page.click("#save")
    page.until("document.getElementById('message').textContent.includes('hil compare saved/seen.parquet')")
    assert "saved 501 rows" in page.run("document.getElementById('message').textContent")
    saved = read_recording(folder / "saved" / "seen.parquet")
    assert saved["time_s"][[0, -1]] == pytest.approx(page.run("[scope.store.rows[0][0], scope.store.rows[0].at(-1)]"))
    assert saved.metadata["bench"]["name"] == "reference"
    rolls(page)


def test_spectrum_and_xy_are_drawn(page: Page) -> None:
    page.click("#fft")
    page.click("#xy")
    page.until("['#fftPlot canvas', '#xyPlot canvas'].every(plot => document.querySelector(plot) !== null)")
    page.click("#fft")
    page.click("#xy")
    assert not page.errors


@pytest.mark.parametrize(("width", "dark"), [(700, False), (700, True), (1600, False), (1600, True)])
def test_the_page_fits_narrow_and_wide_light_and_dark(page: Page, width: int, dark: bool) -> None:
    page.size(width, 1000, dark)
    page.until(f"innerWidth === {width} && scope.panels.all.every(panel => panel.plot.width <= innerWidth)")
    assert page.run("document.documentElement.scrollWidth <= innerWidth")
    background = page.run("getComputedStyle(document.body).backgroundColor.match(/[0-9]+/)[0]")
    assert (int(background) < 100) is dark


def test_the_page_goes_on_after_the_bench_is_started_anew(page: Page, bench: BenchRuns) -> None:
    rolls(page)
    assert page.run("scope.run.name") == "first"
    bench.kill()
    bench.start("second")
    page.until("scope.run.name === 'second' && scope.store.rows[0].length > 50", DEADLINE_S)
    newest = page.run(NEWEST)
    page.until(f"{NEWEST} > {newest}")


@pytest.mark.long
def test_two_recordings_over_each_other_and_a_replay(folder: Path) -> None:
    record(folder, bench_with(), "one")
    record(folder, bench_with({"effects": []}), "two")
    with (
        scope(folder, "one.parquet", "two.parquet") as address,
        browser(folder / "profile2", address) as page,
    ):
        page.until("window.scope && scope.store.still && scope.store.second")
        assert page.run("scope.panels.all[0].plot.series.length") == 1 + 2 * page.run(
            "scope.panels.all[0].names.length"
        )
        first = page.run("scope.store.second.rows[0][0]")
        page.run("(() => { const shift = document.getElementById('shift'); shift.value = '0.2'; shift.onchange(); })()")
        page.until(f"scope.store.second.rows[0][0] === {first} + 0.2")
        page.click("#play")
        page.until("scope.mode === 'rolling'")
        page.until("scope.mode === 'held'")
        assert not page.errors


def test_errors_of_the_page_are_seen(page: Page) -> None:
    """The check above can fail."""
    page.run("setTimeout(() => { throw new Error('on purpose'); }, 0)")
    page.until("new Promise(done => setTimeout(() => done(true), 100))")
    assert any("on purpose" in error for error in page.errors)
    page.errors.clear()
