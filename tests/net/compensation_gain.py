"""Gain of compensations that rest on diagnoses: concealed effects on the simulated reference axis, whole loop.

    python tests/net/compensation_gain.py OUT [--seeds N] [--only EFFECT] [--workers N]     from the repository's root

For each effect and seed: its parameters and wrong masses and friction are drawn and concealed; the axis is recorded,
diagnosed, compensated and run on a motion that nothing was learnt from. A line for each case has the error that the
effect makes (following for a torque, positioning for a place), rms: before, as predicted, after, their ratio, and what
a repetition changes. The same tables are tried with a wrong diagnosis, and on an axis that has another
strength, phase and mass since. The last lines count. Answers are kept in OUT; a stopped run continues.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import count
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from hil.bench.bench_file import Bench, load_bench
from hil.bench.hardware import SimulatedEffect, SimulationSection
from hil.compensating.trial import try_compensation
from hil.control.compensation_tables import Adds
from hil.diagnosis.diagnose import diagnose
from hil.errors import HilError
from hil.loop.run import RunResult, run_profile
from hil.motion.profile import Profile
from hil.recording.recording import Recording, read_recording
from hil.twin.library import BY_ID
from hil.twin.parameter import Role
from hil.validation.proof.draw.demo import LEARN, PROVE, WRONG, from_rest, there_and_back

MOTION = from_rest("other strokes and feeds", [*there_and_back(0.09, 0.05), *there_and_back(0.06, 0.15)])
FADE_S = 1.0
PHASE = (0.0, 6.28)
# effect -> error that it makes, and ranges of its parameters: of axes in service
EFFECTS: dict[str, tuple[Adds, dict[str, tuple[float, float]]]] = {
    "cogging_torque": (Adds.TORQUE, {"amplitude_n_m": (0.1, 0.3), "cycles_per_rev": (6.0, 6.0), "phase_rad": PHASE}),
    "stribeck_friction": (Adds.TORQUE, {"static_torque_n_m": (1.5, 2.0), "stribeck_velocity_rad_s": (1.0, 2.5)}),
    "asymmetric_friction": (Adds.TORQUE, {"offset_torque_n_m": (0.2, 0.4)}),
    "position_dependent_friction": (
        Adds.TORQUE, {"fraction": (0.2, 0.4), "period_m": (0.02, 0.04), "phase_rad": PHASE}),
    "friction_gradient": (Adds.TORQUE, {"slope_1_m": (3.0, 6.0)}),
    "presliding_hysteresis": (Adds.TORQUE, {"stiffness_n_m_rad": (40.0, 120.0)}),
    "nonlinear_viscous_friction": (Adds.TORQUE, {"quadratic_n_m_s2_rad2": (5e-5, 1e-4)}),
    "constant_load": (Adds.TORQUE, {"load_torque_n_m": (0.5, 1.5)}),
    "spring_load": (Adds.TORQUE, {"stiffness_n_m": (2e3, 6e3), "rest_position_m": (0.0, 0.05)}),
    "periodic_lead_error": (Adds.POSITION, {"amplitude_m": (4e-6, 8e-6), "phase_rad": PHASE}),
    "cumulative_lead_error": (Adds.POSITION, {"slope_m_m": (1e-4, 3e-4)}),
    "backlash": (Adds.POSITION, {"gap_m": (8e-6, 20e-6)}),
    "encoder_eccentricity": (Adds.POSITION, {"amplitude_rad": (2e-3, 6e-3), "phase_rad": PHASE}),
}  # fmt: skip


def main() -> None:
    """Answer all cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder for the answers")
    parser.add_argument("--seeds", type=int, default=5, help="cases of each effect")
    parser.add_argument("--only", default="", help="only effects whose name contains this")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    options = parser.parse_args()
    cases = [(effect, seed) for seed in range(1, options.seeds + 1) for effect in EFFECTS if options.only in effect]
    with ProcessPoolExecutor(options.workers) as pool:
        answers = list(pool.map(partial(answer, options.out), *zip(*cases, strict=True)))
    for one in sorted(answers, key=lambda one: one["effect"]):
        print(told(one))
    clear = [one for one in answers if "after_m" in one and one["before_m"] > 5.0 * one["noise_m"]]
    if clear:
        factors = [one["before_m"] / one["after_m"] for one in clear]
        near = [abs(one["predicted_m"] / one["after_m"] - 1.0) <= 0.25 for one in clear]
        print(f"median factor {median(factors):.2f} of {len(clear)} above five times the noise, bar 4")
        print(f"predicted within 25 %: {sum(near)} of {len(near)}")
    harmed = [one for one in answers if one.get("after_m", 0.0) > one.get("before_m", 0.0) + one.get("noise_m", 0.0)]
    print(f"harmed: {len(harmed)} of {len(answers)}; named first: {sum(one['right'] for one in answers)}")
    for kind in ("wrong", "changed"):
        trials = [one[kind] for one in answers if "after_m" in one[kind]]
        worse = sum(one["after_m"] > one["before_m"] + one["noise_m"] for one in trials)
        print(
            f"{kind}: {len(trials)} of {len(answers)} were run, worse than without by more than a repetition: {worse}"
        )


def told(one: dict[str, Any]) -> str:
    """A line of the table."""
    name = f"{one['effect']:28} {one['seed']}  {', '.join(one['named'])[:40]:40}"
    if "after_m" not in one:
        return f"{name} {one['ended']}"
    values = (1e6 * one[key] for key in ("before_m", "predicted_m", "after_m", "noise_m"))
    before, predicted, after, noise = values
    ratio = before / after
    return f"{name} {before:8.2f} {predicted:8.2f} {after:8.2f} µm  {ratio:5.2f}  repetition {noise:.3f} µm"


def answer(out: Path, effect: str, seed: int) -> dict[str, Any]:
    """Return the answer to a case, worked out if it is not in `out`."""
    place = out / f"{effect}_{seed}"
    path = place / "answer.json"
    if not path.exists():
        place.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"effect": effect, "seed": seed} | _answer(place, effect, seed), indent=1))
    return json.loads(path.read_text())  # type: ignore[no-any-return]


def _answer(place: Path, effect: str, seed: int) -> dict[str, Any]:
    adds, ranges = EFFECTS[effect]
    given, seeds = concealed(effect, ranges, seed), count(1000 * seed)

    def run(bench: Bench, profile: Profile, folder: Path, name: str) -> RunResult:
        again = folder / f"{name}.parquet"
        again.unlink(missing_ok=True)  # of a run that was stopped
        return run_profile(bench, profile, folder, name, virtual=True, seed=next(seeds))

    learnt, proved = (recorded(run(given, one, place, name)) for name, one in (("learn", LEARN), ("prove", PROVE)))
    found = diagnose([learnt], [proved], given)
    named = [one.effect for one in found.result.missing]
    told: dict[str, Any] = {"named": named, "right": named[:1] == [effect]}

    def tried(machine: Bench, believed: Bench, folder: str = "") -> dict[str, Any]:
        try:
            trial = try_compensation(machine, believed, found.result, {"other": MOTION}, place / folder, run, FADE_S)
        except HilError as error:
            return {"ended": str(error)}
        if not trial.motions:
            return {"ended": trial.statement}
        (before, after), (motion,) = trial.pairs(adds)[0], trial.motions
        predicted = before * motion.predicted.after.of(adds) / motion.predicted.before.of(adds)
        errors = {"before_m": before, "predicted_m": predicted, "after_m": after, "noise_m": motion.noise_m(adds)}
        return errors | {"kept": [one.name for one in trial.plan.compensation.tables]}

    changed = concealed(effect, ranges, seed + 100, WRONG | {"table_mass_kg": (1.2, 1.3)})
    others = {"wrong": tried(given, mistaken(found.bench), "wrong"), "changed": tried(changed, found.bench, "changed")}
    return told | tried(given, found.bench) | others


def mistaken(diagnosed: Bench) -> Bench:
    """The bench of a wrong diagnosis: strengths twice as large, of the other sign, or half a turn later."""
    entries = []
    for entry in diagnosed.mechanisms:
        values = dict(entry.parameters)
        for parameter in BY_ID[entry.effect].parameters:
            value = values.get(parameter.name)
            if value is not None and parameter.role is Role.STRENGTH:
                wrong = -2.0 * value if parameter.low < 0.0 else 2.0 * value
                values[parameter.name] = min(max(wrong, parameter.low), parameter.high)
            elif value is not None and parameter.role is Role.PHASE:
                values[parameter.name] = value + np.pi if value < 0.0 else value - np.pi
        entries.append(entry.model_copy(update={"parameters": values}))
    return diagnosed.model_copy(update={"mechanisms": tuple(entries)})


def concealed(
    effect: str,
    ranges: dict[str, tuple[float, float]],
    seed: int,
    wrong: dict[str, tuple[float, float]] = WRONG,
) -> Bench:
    """The reference bench with a concealed effect and `wrong` parameters, factors, drawn by `seed`."""
    bench, draw = load_bench("reference"), np.random.default_rng([seed, len(effect)])
    parameters = {name: float(draw.uniform(*limits)) for name, limits in ranges.items()}
    axis = {name: float(getattr(bench.axis, name) * draw.uniform(*limits)) for name, limits in wrong.items()}
    effects = (SimulatedEffect(effect=effect, parameters=parameters),)
    return bench.model_copy(update={"simulation": SimulationSection(axis=axis, effects=effects, seed=seed)})


def recorded(ran: RunResult) -> Recording:
    """The recording of a run. Raises HilError if it stopped early."""
    if not ran.complete or ran.recording is None:
        raise HilError(f"stopped: {ran.outcome.ending}: {ran.outcome.reason}")
    return read_recording(ran.recording)


if __name__ == "__main__":
    main()
