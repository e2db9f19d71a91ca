"""Regression net of the diagnosis: fixed cases, diagnosed again and compared with the stored answers.

    make net                                                             into runs/net
    python tests/net/net.py OUT [--jobs N] [--only PART] [--store]       from the root of the repository

Run it after every change of twin, identification or diagnosis, on idle cores: two cores need about 30 minutes. It draws
the cases of cases.yaml into OUT/cases, diagnoses those without an answer into OUT/answers, and prints every change
against answers.json: verdict, names, parameters beyond a standard error, held-out figures, seconds. It returns 1 if a
right answer became wrong. A stopped run continues with the same command; a new commit needs a new OUT, where OUT/cases
may be copied from an old one to save the drawing. `--only` selects cases by a part of their name; `--store` writes the
answers of this run as the new reference, after every change has been explained. Cases of recordings outside of the
repository are skipped if these are not there.

`make net` then runs tests/net/incidents: a pytest file for each incident that was once diagnosed wrongly, and what is
known of the measured recordings. They are marked `net` and not part of `make test`: pytest -m net.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from hil.bench.bench_file import Bench, load_bench
from hil.diagnosis.diagnose import diagnose
from hil.importing.by_map import import_recording
from hil.recording.recording import Recording, read_recording, write_parquet
from hil.validation.proof.draw.expected import same_law
from hil.validation.proof.draw.generator import draw
from hil.workers.pool import side_by_side

HERE = Path(__file__).parent
REFERENCE = HERE / "answers.json"
RECORDINGS = HERE.parents[2] / "shared" / "recordings"
HELD_OUT_CHANGE = 0.02  # relative change of a held-out rms that is printed
SKIPPED = "skipped: its recordings are not beside the repository"
SLOWER = 1.3  # ratio of seconds that is printed


def main() -> int:
    """Draw, diagnose, compare; returns 1 where an answer changed from right to wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for cases and answers")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), help="cases at once")
    parser.add_argument("--only", default="", help="only cases whose name contains this")
    parser.add_argument("--store", action="store_true", help="write the answers as the new reference")
    options = parser.parse_args()
    cases = [case for case in read_cases() if options.only in case["name"]]
    todo = [Path(case["name"]) for case in cases if not answer_file(options.out, case["name"]).exists()]
    for number, done in enumerate(side_by_side(partial(answer, out=options.out), todo, options.jobs), 1):
        path = answer_file(options.out, done.name)
        print(
            f"[{number}/{len(todo)}] {done.name}: {line(json.loads(path.read_text())) if path.exists() else SKIPPED}",
            flush=True,
        )
    found = {
        case["name"]: json.loads(answer_file(options.out, case["name"]).read_text())
        for case in cases
        if answer_file(options.out, case["name"]).exists()
    }
    if options.store:
        REFERENCE.write_text(
            "{\n"
            + ",\n".join(f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in sorted(found.items()))
            + "\n}\n"
        )
        return 0
    return report(json.loads(REFERENCE.read_text()), found)


def answer_file(out: Path, name: str) -> Path:
    """File with the compact answer to a case."""
    return out / "answers" / f"{name}.json"


def read_cases() -> list[dict[str, Any]]:
    """The cases of the net in the order in which they are diagnosed."""
    cases: list[dict[str, Any]] = yaml.safe_load((HERE / "cases.yaml").read_text())
    return cases


def answer(name: Path, out: Path) -> None:
    """Diagnose the case of a name and write its compact answer; nothing where its recordings are not there."""
    case = next(case for case in read_cases() if case["name"] == name.name)
    recordings = recorded(case, out)
    if recordings is None:
        return
    train, held_out, bench, wanted = recordings
    try:
        entry = compact(diagnose(train, held_out, bench).result.as_json())
    except Exception as error:  # an exception is an answer too: the worst one
        entry = {"verdict": "error", "error": f"{type(error).__name__}: {error}", "named": [], "seconds": 0.0}
    entry["wanted"] = wanted
    entry["data"] = digest([*train, *held_out])
    path = answer_file(out, case["name"])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(entry))


def recorded(case: dict[str, Any], out: Path) -> tuple[list[Recording], list[Recording], Bench, Any] | None:
    """Training and held-out recordings of a case, its bench, and the right answer: [verdict, ids of each effect]."""
    if "folder" in case:
        folder = RECORDINGS / case["folder"]
        if not folder.is_dir():
            return None
        wanted = [case["verdict"], [[case["effect"]]] if "effect" in case else []]
        if "map" in case:
            return [import_recording(folder / case["file"], case["map"])], [], load_bench(case["bench"]), wanted
        train = [read_recording(folder / f"train_{number}.csv") for number in (1, 2)]
        return train, [read_recording(folder / "holdout.csv")], load_bench(folder.parent / "axis.yaml"), wanted
    place = out / "cases" / case["name"]
    if not (place / "truth.json").exists():
        drawn = draw(case["tier"], case["number"], case["seed"], case.get("effect"), case.get("axis"))
        place.mkdir(parents=True, exist_ok=True)
        for recording in drawn.recordings:
            path = place / f"{recording.name}.parquet"
            path.unlink(missing_ok=True)
            write_parquet(recording, path)
        plain = drawn.bench.model_dump(mode="json", exclude_defaults=True)
        (place / "bench.yaml").write_text(yaml.safe_dump(plain, sort_keys=False))
        laws = [same_law(effect.effect) for effect in drawn.truth.effects]
        (place / "truth.json").write_text(json.dumps([drawn.truth.verdict, [list(law) for law in laws if law]]))
    verdict, laws = json.loads((place / "truth.json").read_text())
    train = [read_recording(place / f"train_{number}.parquet") for number in (1, 2)]
    return (
        train,
        [read_recording(place / "holdout.parquet")],
        load_bench(place / "bench.yaml"),
        [case.get("verdict", verdict), laws],
    )


def digest(recordings: list[Recording]) -> str:
    """Digest of the recordings to six digits: another machine's linear algebra may change the last ones."""
    text = ";".join(
        f"{name} {np.sqrt(np.mean(np.square(values))):.6g}"
        for recording in recordings
        for name, values in sorted(recording.columns.items())
    )
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def compact(result: dict[str, Any]) -> dict[str, Any]:
    """The parts of diagnosis.json that are compared."""
    rounded = lambda value: float(f"{value:.5g}")  # noqa: E731
    return {
        "verdict": result["verdict"],
        "named": [
            [found["effect"], found["variant"], round(found["confidence"], 3), list(found["equivalents"])]
            for found in result["missing"]
        ],
        "parameters": {
            f"{found['effect']}.{name}": [rounded(entry["value"]), rounded(entry["std"])]
            for found in result["missing"]
            for name, entry in found["parameters"].items()
        },
        "corrections": {
            name: [rounded(entry["value"]), rounded(entry["std"])]
            for name, entry in result["parameter_corrections"].items()
        },
        "held_out": {
            name: [rounded(entry["validate"]["after_rms"]), rounded(entry["validate"]["noise_floor_rms"])]
            for name, entry in result["fit"].items()
            if entry["validate"]
        },
        "block": (result["location"] or {}).get("block"),
        "not_testable": result["not_testable"],
        "unexplained": rounded(result["unexplained"]["share"]),
        "seconds": round(result["runtime_s"], 1),
    }


def right(entry: dict[str, Any]) -> bool:
    """Return True for the right verdict with every concealed effect named or in a reported set, and no other name."""
    verdict, laws = entry["wanted"]
    named = [{effect, *equivalents} for effect, _, _, equivalents in entry["named"]]
    return bool(
        entry["verdict"] == verdict
        and (
            verdict != "missing_physics"
            or (len(named) == len(laws) and all(any(found & set(law) for found in named) for law in laws))
        )
    )


def line(entry: dict[str, Any]) -> str:
    """An answer in one line."""
    names = ", ".join(
        f"{effect}{f'/{variant}' if variant else ''} {confidence:.2f}"
        for effect, variant, confidence, _ in entry["named"]
    )
    return (
        f"{'right' if right(entry) else 'WRONG'} {entry['verdict']} [{names}] {entry['seconds']:.0f} s"
        f"{' ' + entry['error'] if 'error' in entry else ''}"
    )


def report(before: dict[str, Any], after: dict[str, Any]) -> int:
    """Print what changed; returns 1 where a right answer became wrong."""
    lost = 0
    for name in sorted(set(before) & set(after)):
        old, new = before[name], after[name]
        found = changes(old, new)
        lost += right(old) and not right(new)
        if found:
            print(f"{name}: {line(old)} -> {line(new)}")
            print("".join(f"    {text}\n" for text in found), end="")
    both = sorted(set(before) & set(after))
    seconds = np.array([[before[name]["seconds"], after[name]["seconds"]] for name in both])
    print(
        f"{len(both)} cases compared, {len(set(before) - set(after))} without an answer; right "
        f"{sum(right(before[name]) for name in both)} -> {sum(right(after[name]) for name in both)}, "
        f"right before and wrong now: {lost}; seconds {seconds[:, 0].sum():.0f} -> {seconds[:, 1].sum():.0f}, "
        f"median {np.median(seconds[:, 0]):.1f} -> {np.median(seconds[:, 1]):.1f}"
    )
    return int(lost > 0)


def changes(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """List the differences between two answers to a case, a line each."""
    found = []
    if old["data"] != new["data"]:
        found.append("its recordings differ from those of the reference: the answers cannot be compared")
    for key in ("verdict", "block"):
        if old.get(key) != new.get(key):
            found.append(f"{key}: {old.get(key)} -> {new.get(key)}")
    if [entry[:2] for entry in old["named"]] != [entry[:2] for entry in new["named"]]:
        found.append("names differ")
    for one, other in zip(old["named"], new["named"], strict=False):
        if one[0] == other[0] and abs(one[2] - other[2]) > 0.02:
            found.append(f"confidence of {one[0]}: {one[2]:.3f} -> {other[2]:.3f}")
        if one[0] == other[0] and one[3] != other[3]:
            found.append(f"equivalents of {one[0]}: {one[3]} -> {other[3]}")
    for key in ("parameters", "corrections"):
        for name in old.get(key, {}).keys() & new.get(key, {}).keys():
            (value, std), (value_now, std_now) = old[key][name], new[key][name]
            if abs(value_now - value) > max(std, 1e-4 * abs(value)):
                found.append(f"{name}: {value:.5g} ± {std:.2g} -> {value_now:.5g} ± {std_now:.2g}")
    for name in old.get("held_out", {}).keys() & new.get("held_out", {}).keys():
        (rms, floor), (rms_now, floor_now) = old["held_out"][name], new["held_out"][name]
        if abs(rms_now - rms) > HELD_OUT_CHANGE * rms or abs(floor_now - floor) > HELD_OUT_CHANGE * floor:
            found.append(f"held out {name}: {rms:.4g} (floor {floor:.4g}) -> {rms_now:.4g} (floor {floor_now:.4g})")
    if set(old.get("not_testable", ())) != set(new.get("not_testable", ())):
        found.append(
            f"not testable: {sorted(set(old.get('not_testable', ())) ^ set(new.get('not_testable', ())))} differ"
        )
    if new["seconds"] > SLOWER * old["seconds"] + 2.0:
        found.append(f"seconds: {old['seconds']} -> {new['seconds']}")
    return found


if __name__ == "__main__":
    sys.exit(main())
