"""hil latency: counts, percentiles, the judgement of a rate, and cyclictest beside the loop."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import hil, refused
from hypothesis import given
from hypothesis import strategies as st

from hil.loop import latency
from hil.loop.disturbances import Disturbances
from hil.loop.latency import HALF_DECADES, Cyclictest, Latencies, Series, load, measure
from hil.loop.suitability import RATES_HZ, Suitability, beside, judge

# What cyclictest 2.4 writes for 6 wake-ups, three of them beyond its histogram.
RESULTS = {"thread": {"0": {"histogram": {"15": 2, "1200": 1}, "cycles": 6, "max": 2500000}}}


def series(latencies_s: dict[float, int], period_s: float = 0.001) -> Series:
    counted = Latencies(latencies_s)
    return Series(period_s, counted, counted, None, "", (), Disturbances(0, 0, 0, 1))


@given(st.dictionaries(st.floats(0.0, 0.5), st.integers(1, 1000), min_size=1, max_size=30))
def test_bins_and_percentiles_hold_every_wake_up(counts: dict[float, int]) -> None:
    one = Latencies(counts)
    every = sorted(latency_s for latency_s, count in counts.items() for _ in range(count))
    assert sum(one.bins()) == one.total == len(every)
    assert one.bins()[0] == sum(latency_s < HALF_DECADES[0] for latency_s in every)
    assert one.bins()[-1] == sum(latency_s >= HALF_DECADES[-1] for latency_s in every)
    for part in (0.5, 0.99, 0.999, 1.0):
        assert one.quantile(part) == every[math.ceil(part * len(every)) - 1]
    assert one.largest_s == every[-1]


def test_without_a_wake_up_no_latency_is_told() -> None:
    assert (Latencies({}).total, Latencies({}).largest_s, Latencies({}).quantile(0.5)) == (0, 0.0, 0.0)


def test_a_stall_misses_as_many_periods_as_it_lasts() -> None:
    assert Latencies({0.0032: 1, 1e-5: 999}).missed(0.001) == 3
    assert Latencies({0.0032: 1, 1e-5: 999}).missed(0.004) == 0


class StalledClock:
    """Clock whose tick 3 comes 3.2 periods late, and those after it on time."""

    def __init__(self, period_s: float, spin_s: float = 0.0) -> None:
        self.late_s = {3: 3.2 * period_s}

    def start(self) -> None:
        """Do nothing."""

    def wait(self, tick: int) -> float:
        assert tick not in (4, 5, 6)  # they have passed: a loop that caught up would count one stall four times
        return self.late_s.get(tick, 1e-6)


def test_periods_that_a_stall_took_are_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latency, "WallClock", StalledClock)
    found = measure(0.001, 0.01)
    assert found.tick.counts == {0.0032: 1, 1e-6: 6}
    assert found.tick.missed(0.001) == 3


@pytest.mark.parametrize(
    ("latencies_s", "suitability"),
    [
        ({1e-5: 9999, 1e-4: 10}, Suitability.GOOD),
        ({1e-5: 9999, 1.1e-4: 11}, Suitability.LIMITED),  # p99.9 above a tenth of the period
        ({1e-5: 9999, 0.001: 1}, Suitability.LIMITED),  # a period missed
        ({1e-5: 9999, 0.00299: 1}, Suitability.LIMITED),
        ({1e-5: 9999, 0.003: 1}, Suitability.UNSUITABLE),  # the data of the devices become stale
        ({1e-5: 989, 5e-4: 11}, Suitability.LIMITED),  # the budget of arming
        ({1e-5: 989, 5.1e-4: 11}, Suitability.UNSUITABLE),
    ],
)
def test_a_rate_is_judged_by_missed_periods_tails_and_stalls(
    latencies_s: dict[float, int], suitability: Suitability
) -> None:
    judged = judge(1000.0, series(latencies_s))
    assert judged.suitability is suitability
    assert str(sum(latencies_s.values())) in judged.reason
    slower = judge(1000.0 / 100, series(latencies_s))
    assert slower.suitability is Suitability.GOOD  # a stall has a duration, whatever the rate


def test_missed_periods_are_laid_on_the_machine_only_if_cyclictest_missed_them_too() -> None:
    late, calm = Latencies({0.0031: 1, 1e-5: 99}), Latencies({1e-5: 100})
    assert "the machine, not this program" in beside(late, Latencies({0.002: 1, 1e-5: 99}), 0.001)
    assert "more than the machine explains" in beside(late, calm, 0.001)
    assert beside(calm, late, 0.001) == "periods missed: loop 0, cyclictest 3"


def test_no_tick_and_no_wake_up_is_early() -> None:
    found = measure(0.002, 0.1)
    assert found.tick.total == found.wake_up.total
    assert found.tick.total + found.tick.missed(0.002) >= 50
    assert found.tick.total <= 50
    assert min(found.tick.counts) >= 0.0
    assert min(found.wake_up.counts) >= 0.0
    assert found.disturbances.collections == 0


def cyclictest(folder: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Put a program cyclictest before all others."""
    program = folder / "cyclictest"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")


def test_the_histogram_of_cyclictest_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cyclictest(
        tmp_path, monkeypatch,
        f"for a; do case $a in --json=*) echo '{json.dumps(RESULTS)}' > ${{a#--json=}};; esac; done; "
        f"echo \"$@\" > {tmp_path}/asked",
    )  # fmt: skip
    found = measure(0.002, 0.1)
    assert found.reference == Latencies({15e-6: 2, 1200e-6: 1, 1.0: 2, 2.5: 1})
    asked = (tmp_path / "asked").read_text().split()
    assert {"--interval=2000", "--loops=50", "--priority=80", "--mlockall", "--secaligned"} <= set(asked)


@pytest.mark.parametrize(("cycles", "most_us", "counts"), [
    (3, 1200, {15e-6: 2, 1200e-6: 1}),
    (4, 2_500_000, {15e-6: 2, 1200e-6: 1, 2.5: 1}),
    (5, 2_500_000, {15e-6: 2, 1200e-6: 1, 2.5: 1, 1.0: 1}),
    (4, 0, {15e-6: 2, 1200e-6: 1, 1.000001: 1}),  # at least beyond the histogram
])  # fmt: skip
def test_what_is_beyond_the_histogram_is_counted_at_its_end(
    tmp_path: Path, cycles: int, most_us: int, counts: dict[float, int]
) -> None:
    results = tmp_path / "results.json"
    told = {"histogram": {"15": 2, "1200": 1}, "cycles": cycles, "max": most_us}
    results.write_text(json.dumps({"thread": {"0": told}}))
    ended = Cyclictest(SimpleNamespace(communicate=lambda: ("", "")), results)
    ended.finish()
    assert ended() == (Latencies(counts), "")


@pytest.mark.parametrize(("latencies_s", "reason"), [
    ({2e-6: 8, 5e-5: 1}, "no period missed in 9 ticks (95 % sure: fewer than 1 in 3); p99.9 50 us, at most 100 us"),
    ({2e-6: 2}, "no period missed in 2 ticks (95 % sure: fewer than 1 in 1); p99.9 2.0 us, at most 100 us"),
    ({1e-5: 999, 0.0021: 1}, "2 periods missed in 1000 ticks, p99.9 10 us (good: none, at most 100 us); a bench "
                             "arms, and no stall outlasts 3 periods"),
    ({1e-5: 9, 0.0075: 1}, "7 periods missed in 10 ticks; p99 7500 us, at most 500 us (drive.jitter_p99); longest "
                           "stall 7500 us, allowed 3000 us (drive.missed_answers)"),
])  # fmt: skip
def test_a_judgement_in_words(latencies_s: dict[float, int], reason: str) -> None:
    assert judge(1000.0, series(latencies_s)).reason == reason


@pytest.mark.parametrize(("loop", "other", "words"), [
    (4, 2, "periods missed: loop 4, cyclictest 2: the machine, not this program"),
    (5, 2, "periods missed: loop 5, cyclictest 2: more than the machine explains"),
    (1, 1, "periods missed: loop 1, cyclictest 1: the machine, not this program"),
    (1, 0, "periods missed: loop 1, cyclictest 0: more than the machine explains"),
])  # fmt: skip
def test_twice_the_missed_periods_of_cyclictest_are_the_machine(loop: int, other: int, words: str) -> None:
    assert beside(*(Latencies({1e-6: 100, 0.001 * count + 1e-5: 1}) for count in (loop, other)), 0.001) == words


@pytest.mark.long
def test_why_cyclictest_gave_nothing_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cyclictest(tmp_path, monkeypatch, "echo Unable to change scheduling policy! >&2; exit 1")
    assert measure(0.002, 0.02).why_not == "cyclictest failed: Unable to change scheduling policy!"
    monkeypatch.setenv("PATH", "/nowhere")
    found = measure(0.002, 0.02)
    assert found.reference is None
    assert "apt install rt-tests" in found.why_not


def test_the_load_ends_with_the_measurement() -> None:
    def busy() -> list[str]:
        listed = subprocess.run(
            ["ps", "-o", "args=", "--ppid", str(os.getpid())], capture_output=True, text=True, check=True
        )
        return [line for line in listed.stdout.splitlines() if "sched_setaffinity" in line]

    with load() as processes:
        assert len(busy()) == processes == len(os.sched_getaffinity(0))
    assert busy() == []


def test_the_command_prints_a_histogram_of_80_columns(tmp_path: Path) -> None:
    ran = hil(tmp_path, "latency", "--seconds", "0.2", "--period", "0.001")
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    assert re.match(r"latency at 1000 Hz, \d+ ticks", lines[0])
    assert [
        len(line) for line in lines if len(line) > 80 and "cyclictest" not in line and "not granted" not in line
    ] == []
    for rate_hz in RATES_HZ:
        assert any(line.startswith(f"{rate_hz:5g} Hz  ") for line in lines)


@pytest.mark.long
def test_json_has_every_count(tmp_path: Path) -> None:
    ran = hil(tmp_path, "latency", "--seconds", "0.1", "--json", "--load")
    data = json.loads(ran.stdout)
    assert [one["period_s"] for one in data["series"]] == [0.004, 0.001, 0.0005]
    for one in data["series"]:
        assert sum(one["tick"]["counts"]) == one["tick"]["ticks"]
        assert one["tick"]["ticks"] <= round(0.1 / one["period_s"]) <= one["tick"]["ticks"] + one["tick"]["missed"]
        assert len(one["tick"]["counts"]) == len(data["bin_edges_s"]) + 1
    assert [rate["rate_hz"] for rate in data["rates"]] == list(RATES_HZ)
    assert {rate["suitability"] for rate in data["rates"]} <= set(Suitability)
    assert data["busy_processes"] > 0


@pytest.mark.parametrize("arguments", [("--period", "0"), ("--period", "nan"), ("--seconds", "0"), ("--seconds", "x")])
def test_wrong_arguments_are_refused(tmp_path: Path, arguments: tuple[str, str]) -> None:
    assert arguments[0] in refused(tmp_path, "latency", *arguments)
