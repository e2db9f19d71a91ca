"""Forces in windows added to the EMPS recording through its plant: are they found, with their edges and heights?

    python tests/net/force_windows.py OUT [--seed S] [--draws N]     from the root, recordings beside the repository

Each draw has 1, 5 and 30 windows, of one height at equal intervals or of 20 to 200 N and either sign at random times,
over the whole recording or in its last third, which is held out: N x 3 x 2 x 2 cases. All are drawn first, and the
SHA-256 of OUT/truths.json is printed before any is diagnosed. A line for each case: windows found of all, edges within
5 ms (and within twice their standard error: friction holds a force at rest, where its edge may lie anywhere), heights
within 1 % (and within 2 N, twice the force that the best model leaves on EMPS), the worst of each, other names,
seconds. Answers are kept in OUT; a stopped run continues.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
from emps_windows import Push, irregular, pushed, regular

from hil.bench.bench_file import load_bench
from hil.diagnosis.diagnose import diagnose
from hil.twin.mechanisms import external_force

WHOLE_S, HELD_OUT_S = (0.6, 24.3), (17.2, 24.3)
COUNTS = (1, 5, 30)
EDGE_S, SHARE, MISFIT_N = 5e-3, 0.01, 2.0


class Score(NamedTuple):
    """Windows of a case that were found, their edges and heights within the bounds, and the worst of each."""

    windows: int
    edges: int
    edges_told: int
    heights: int
    heights_2n: int
    worst_edge_s: float
    worst_height: float


def main() -> None:
    """Draw, seal, diagnose and score."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for truths and answers")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--draws", type=int, default=1)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    truths = options.out / "truths.json"
    if not truths.exists():
        truths.write_text(json.dumps(drawn(options.seed, options.draws), indent=1))
    print(f"SHA-256 of the truths: {hashlib.sha256(truths.read_bytes()).hexdigest()}", flush=True)
    total = np.zeros(6, dtype=int)
    for name, pushes in json.loads(truths.read_text()).items():
        wanted = [Push(*push) for push in pushes]
        found = answer(options.out / f"{name}.json", wanted)
        score = scored(wanted, found["windows"])
        total += (len(wanted), *score[:5])
        edges = f"edges {score.edges:2} of {2 * len(wanted):2} ({score.edges_told} as told"
        heights = f"heights {score.heights:2} ({score.heights_2n} within 2 N"
        print(
            f"{name:22} windows {score.windows:2} of {len(wanted):2} (named {len(found['windows'])}), "
            f"{edges}, worst {1e3 * score.worst_edge_s:.1f} ms), {heights}, worst {100 * score.worst_height:.1f} %), "
            f"also: {', '.join(found['others']) or 'nothing'}, {found['seconds']:.0f} s",
            flush=True,
        )
    count, windows, edges, told, heights, within = total
    print(
        f"windows {windows} of {count}, edges {edges} of {2 * count} ({told} as told), "
        f"heights {heights} ({within} within 2 N)"
    )


def drawn(seed: int, draws: int) -> dict[str, list[Push]]:
    """Windows of all cases by name."""
    rng = np.random.default_rng(seed)
    cases = {}
    for draw in range(draws):
        for count in COUNTS:
            for place, (start_s, end_s) in (("whole", WHOLE_S), ("held_out", HELD_OUT_S)):
                begin_s = start_s + rng.uniform(0.0, 0.2)
                height_n = float(rng.choice([-1.0, 1.0]) * rng.uniform(20.0, 200.0))
                cases[f"{draw}_{count}_regular_{place}"] = regular(count, height_n, begin_s, end_s)
                cases[f"{draw}_{count}_irregular_{place}"] = irregular(
                    count, int(rng.integers(1 << 31)), begin_s, end_s
                )
    return cases


def answer(path: Path, pushes: list[Push]) -> dict[str, Any]:
    """Diagnose a case, or read its answer."""
    if not path.exists():
        begin = time.monotonic()
        result = diagnose([pushed(pushes)], [], load_bench("emps_symmetric")).result
        own = external_force.MECHANISM.id
        windows = [
            (one.start.value, one.end.value, one.strength.value, one.start.std, one.end.std)
            for finding in result.findings
            if finding.effect == own
            for one in finding.windows
        ]
        others = [f"{one.effect} {one.confidence:.2f}" for one in result.findings if one.effect != own]
        path.write_text(json.dumps({"windows": windows, "others": others, "seconds": time.monotonic() - begin}))
    return json.loads(path.read_text())  # type: ignore[no-any-return]


def scored(wanted: list[Push], windows: list[list[float]]) -> Score:
    """Compare each window with the found one that overlaps it most."""
    count = edges = told = heights = within = 0
    worst_edge_s = worst_height = 0.0
    for push in wanted:
        overlaps = [min(push.end_s, end) - max(push.start_s, start) for start, end, *_ in windows]
        if not overlaps or max(overlaps) <= 0.0:
            continue
        start, end, force_n, *errors = windows[int(np.argmax(overlaps))]
        errors_s = (abs(start - push.start_s), abs(end - push.end_s))
        error_n = abs(force_n - push.force_n)
        count += 1
        edges += sum(error_s <= EDGE_S for error_s in errors_s)
        told += sum(error_s <= max(EDGE_S, 2.0 * std_s) for error_s, std_s in zip(errors_s, errors, strict=True))
        heights += error_n <= SHARE * abs(push.force_n)
        within += error_n <= max(MISFIT_N, SHARE * abs(push.force_n))
        worst_edge_s = max(worst_edge_s, *errors_s)
        worst_height = max(worst_height, error_n / abs(push.force_n))
    return Score(count, edges, told, heights, within, worst_edge_s, worst_height)


if __name__ == "__main__":
    main()
