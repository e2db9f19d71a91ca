"""Real recordings of which less is known: the rig's four axes and EMPS, each in every way of `less_known.WAYS`.

    python tests/net/less_known.py OUT [--only PART]     from the root of the repository, recordings beside it

It prints a line for each: verdict, names with confidence, seconds, and `same` if the first name is that of the complete
recording, `hidden` if that effect is said not to be testable and nothing is named. `stamps` are a CSV file with jitter,
a gap and an offset of the clock. The last line counts both. Answers are kept in OUT; a stopped run continues.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.diagnose import diagnose
from hil.errors import HilError
from hil.importing.by_map import import_recording
from hil.recording.recording import Recording, read_recording
from hil.validation.proof.draw.less_known import WAYS, forget

RECORDINGS = Path(__file__).parents[3] / "shared" / "recordings"
RIG = ("null", "stribeck", "backlash", "lead")
COMPLETE, STAMPS = "complete", "stamps"
JITTER, GAP_S, OFFSET_S = 0.2, 0.5, 1.7e9  # of the period; lost from the middle; of the clock


def main() -> None:
    """Diagnose all and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the answers")
    parser.add_argument("--only", default="", help="only those whose name contains this")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    kept = asked = 0
    for name in (*RIG, "emps"):
        whole = answer(options.out, name, COMPLETE)["names"][:1]
        for way in (COMPLETE, *WAYS, STAMPS):
            if options.only not in f"{name} {way}" or (name == "emps" and way == "one encoder"):
                continue
            found = answer(options.out, name, way)
            names = [one[0] for one in found["names"]]
            same = names[:1] == [one[0] for one in whole]
            hidden = not names and bool(whole) and whole[0][0] in found["not_testable"]
            kept, asked = kept + (same or hidden), asked + 1
            word = "same" if same else "hidden" if hidden else "CHANGED"
            told = ", ".join(f"{one} {confidence:.2f}" for one, confidence in found["names"])
            print(f"{name:9} {way:17} {word:8} {found['verdict']:16} {found['seconds']:4.0f} s  {told}", flush=True)
    print(f"same or said not testable: {kept} of {asked}")


def answer(out: Path, name: str, way: str) -> dict[str, list[tuple[str, float]]]:
    """Return the answer to a recording, diagnosed if it is not in `out`."""
    path = out / f"{name}_{way.replace(' ', '_')}.json"
    if not path.exists():
        train, held_out, bench = load(name)
        rng = np.random.default_rng([3, len(name), len(way)])
        if way in WAYS:
            together, bench = forget(way, [*train, *held_out], bench, rng)
            train, held_out = together[: len(train)], together[len(train) :]
        elif way == STAMPS:
            train, held_out = ([stamped(run, out, rng) for run in runs] for runs in (train, held_out))
        begin = time.monotonic()
        try:
            result = diagnose(train, held_out, bench).result
            found = {
                "verdict": str(result.verdict),
                "names": [(one.effect, one.confidence) for one in result.findings],
                "not_testable": list(result.not_testable),
                "notes": list(result.notes),
            }
        except HilError as error:
            found = {"verdict": "refused", "names": [], "not_testable": [], "notes": [str(error)]}
        path.write_text(json.dumps(found | {"seconds": time.monotonic() - begin}, indent=1))
    return json.loads(path.read_text())  # type: ignore[no-any-return]


def load(name: str) -> tuple[list[Recording], list[Recording], Bench]:
    """Return training and held-out recordings and the bench of one axis."""
    if name == "emps":
        return [import_recording(RECORDINGS / "emps" / "DATA_EMPS.mat", "emps")], [], load_bench("emps_symmetric")
    runs = [read_recording(RECORDINGS / "rig" / name / f"{run}.csv") for run in ("train_1", "train_2", "holdout")]
    return runs[:2], runs[2:], load_bench(RECORDINGS / "rig" / "axis.yaml")


def stamped(run: Recording, folder: Path, rng: np.random.Generator) -> Recording:
    """Write a recording with uneven stamps as CSV and read it back."""
    rows = len(run)
    kept = np.ones(rows, dtype=bool)
    kept[rows // 2 : rows // 2 + round(GAP_S / run.period_s)] = False
    time_s = OFFSET_S + (np.arange(rows) + rng.uniform(-JITTER, JITTER, rows)) * run.period_s
    names = [name for name in run.columns if name != "time_s"]
    table = np.column_stack([time_s, *(run[name] for name in names)])[kept]
    path = folder / f"{run.name}.csv"
    np.savetxt(path, table, delimiter=",", header=",".join(["time_s", *names]), comments="", fmt="%.17g")
    return read_recording(path)


if __name__ == "__main__":
    main()
