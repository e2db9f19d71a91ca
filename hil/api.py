"""Verbs of the public API that combine several layers. Use them as `hil.simulate`, `hil.diagnose` and so on.

Everything heavy is imported inside the functions, so that `hil.simulate` does not load the diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import FloatArray
from hil.errors import FieldError, HilError, InputError

if TYPE_CHECKING:
    from hil.bench.bench_file import Bench
    from hil.diagnosis.diagnosis import Diagnosis
    from hil.diagnosis.experiment import Experiment
    from hil.drafting.drafted_bench import DraftedBench
    from hil.identification.nominal_fit import FitResult
    from hil.investigation import Investigation
    from hil.loop.run import RunResult
    from hil.motion.profile import Profile
    from hil.motion.trajectory import Trajectory
    from hil.recording.recording import Recording


class _RowsInMemory:
    """Rows of a session, kept as blocks (k, channels)."""

    def __init__(self) -> None:
        self.blocks: list[FloatArray] = []

    def record(self, row: Sequence[float]) -> None:
        self.blocks.append(np.array(row, dtype=np.float64)[np.newaxis])

    def record_block(self, rows: FloatArray) -> None:
        self.blocks.append(rows.copy())


def simulate(bench: Bench, trajectory: Trajectory, *, seed: int | None = None, name: str = "simulated") -> Recording:
    """Run a trajectory on the simulated axis of a bench in virtual time; no file is written.

    The axis is the one of `bench.simulation` (true parameters, concealed effects, sensors), else the axis of the bench
    file without any effect. Controller, drive and encoders answer over an in-process CANopen bus as in `hil.run`.

    bench: must have the trajectory's period (`bench.period_s`). trajectory: n set-points; the axis starts at rest at
    the first. seed: of the sensor noise; None takes that of the bench. Returns a recording of n rows, SI units in the
    names of its channels. Raises FieldError for another period or parameters that cannot be simulated, HilError if the
    axis is stopped before the end, for example by a following error.
    """
    from hil.loop.bounds import make_cycle
    from hil.loop.clock import VirtualClock
    from hil.loop.devices import Rig
    from hil.loop.session import Session
    from hil.loop.simulated_bench import make_plant, simulated_copy
    from hil.loop.supervision import Ending
    from hil.loop.virtual import compiled_ticks
    from hil.motion.pieces import MotionLimits
    from hil.recording.recording import Recording

    if trajectory.period_s != bench.period_s:
        raise FieldError(
            ("period_s",),
            f"given a trajectory with {trajectory.period_s:g} s, allowed {bench.period_s:g} s, the period of the bench "
            f"{bench.name}; plan it with bench.period_s",
        )
    bench = simulated_copy(bench)
    plant = make_plant(bench, seed)
    plant.reset(float(trajectory.position_m[0]))
    # a stop needs limits: the largest set-points of the trajectory, of which those at rest are 0
    peaks = (trajectory.velocity_m_s, trajectory.acceleration_m_s2, trajectory.jerk_m_s3)
    limits = MotionLimits(*(float(np.max(np.abs(values))) or 1.0 for values in peaks))
    rows = _RowsInMemory()
    with Rig(bench, plant=plant) as rig:
        rig.set_up()
        cycle = make_cycle(rig, rig.drive.read(0.0).motor_position_rad, limits)
        ticks = compiled_ticks(rig, rows)
        outcome = Session(rig, cycle, trajectory, limits, VirtualClock(), rows, ticks).run()
    if outcome.ending is not Ending.COMPLETE:
        raise HilError(f"{bench.name}: the simulated run stopped: {outcome.ending}: {outcome.reason}")
    columns = dict(zip(cycle.channels, np.ascontiguousarray(np.concatenate(rows.blocks).T), strict=True))
    metadata = {"bench": bench.model_dump(mode="json"), "seed": seed, "simulated": True}
    return Recording(name, columns, bench.period_s, metadata)


def run(
    bench: Bench,
    profile: Profile,
    folder: str | Path,
    name: str = "run",
    *,
    virtual: bool = False,
    force: bool = False,
    seed: int | None = None,
) -> Recording:
    """Run a profile on a real or simulated bench and record it as `folder`/`name`.parquet.

    On a bench with hardware the axis moves. virtual: as fast as the machine allows, simulated benches only. force: arm
    although jitter, bus load or the watchdog of the drive forbid it. seed: of the noise of simulated sensors.

    Returns the recording, one row per tick of the velocity loop. Raises FieldError for a profile that the bench does
    not allow, NotArmed (a HilError) for what `force` overrides, HilError for a device that cannot be set up or
    if the run stopped before its end; the recording up to there stays in `folder`.
    """
    from hil.loop.run import run_profile
    from hil.recording.recording import read_recording

    result = run_profile(bench, profile, folder, name, virtual=virtual, force=force, seed=seed)
    if not result.complete or result.recording is None:
        raise HilError(
            f"{name} stopped: {result.outcome.ending}: {result.outcome.reason}; its recording: {result.recording}"
        )
    return read_recording(result.recording)


def identify(recordings: Recording | Sequence[Recording]) -> DraftedBench:
    """Draft the bench of an axis from its recordings alone: masses, friction, lead, gains, encoders.

    recordings: of one axis, with position and torque of the motor in both directions; several tell more than one.

    Returns the draft: `bench` to go on with, `values` with standard errors, `unsure` is what to check, `text` the file
    that `hil.save` writes. Raises InputError if masses and friction cannot be told, with what is missing.
    """
    from hil.drafting.drafted_bench import drafted

    return drafted(_given(recordings, "identify"))


def fit_nominal(recordings: Recording | Sequence[Recording], bench: Bench) -> FitResult:
    """Fit the nominal parameters of a bench (masses, stiffness, friction) to recordings.

    Prediction error block by block: each block of the loop is fed its measured inputs, each residual is weighted by its
    noise (Ljung, System Identification, 1999, ch. 7). Parameters stay within a factor of three of the bench file.

    Returns the fitted bench, its parameters with standard errors, and whether the fit converged. Raises InputError if
    recording and bench do not belong together, HilError if no parameters give a finite response.
    """
    from hil.identification.dataset import prepare_dataset
    from hil.identification.derived_channels import reduced
    from hil.identification.measured import take
    from hil.identification.nominal_fit import fit_nominal as fit

    given = _given(recordings, "fit to")
    bench = reduced(bench, given)
    return fit(prepare_dataset([take(recording, bench) for recording in given], bench))


def diagnose(
    recordings: Recording | Sequence[Recording],
    bench: Bench,
    *,
    held_out: Recording | Sequence[Recording] = (),
    progress: Callable[[str], None] = lambda text: None,
    budget_s: float | None = None,
) -> Diagnosis:
    """Find the physics that the twin of a bench lacks: where it acts, its parameters, and a proof.

    recordings: to learn from, of one axis. bench: as its owner describes it; wrong parameters are estimated. held_out:
    recordings of another motion that nothing is fitted to; without any, a third of each recording. progress:
    called with a text at each step. budget_s: processor time [s]; a search that needs more ends with the best
    explanation so far, marked in `result.time_budget`.

    Returns the diagnosis; `result` has verdict, findings with standard errors, location and held-out figures, `bench`
    the corrected bench. Raises InputError for recordings that cannot be diagnosed, with all reasons.
    """
    from hil.diagnosis.diagnose import diagnose as diagnose_recordings

    return diagnose_recordings(_sequence(recordings), _sequence(held_out), bench, progress, budget_s)


def design_experiment(diagnosis: Diagnosis) -> Experiment | None:
    """Give the motion that separates the causes that a diagnosis left open, or shows those its motion cannot show.

    T-optimal design (Atkinson and Fedorov, 1975) over motions within the travel and the limits of the bench file, else
    of the recordings; the diagnosis has computed it. Returns None if nothing is open. `profile` of the result is None
    if no motion in reach answers anything, `separates` are ids of mechanisms, `note` says what is expected.
    """
    return diagnosis.experiment


def investigate(
    profiles: Mapping[str, Profile],
    bench: Bench,
    folder: str | Path,
    *,
    held_out: Mapping[str, Profile] | None = None,
    rounds: int = 3,
    virtual: bool = False,
    seed: int | None = None,
    confirm: Callable[[Profile], bool] | None = None,
) -> Investigation:
    """Run profiles, diagnose, run the motion that separates what is open, and repeat until one cause remains.

    profiles: by the name of their recording. folder: new or empty; gets recordings, designed profiles and the
    diagnosis.json of each round. held_out: profiles run in the first round for the proof. rounds: at most. virtual,
    seed: as in `run`, each run with a seed of its own. confirm: asked before a designed motion is run; without it,
    designed motions are run on simulated benches only.

    Returns all rounds and why the last one was the last. Raises InputError for recordings that cannot be diagnosed or a
    folder in use, HilError if a run stops before its end.
    """
    from hil.files.output import refuse_used
    from hil.investigation import investigate as investigate_bench
    from hil.loop.run import run_profile

    refuse_used(Path(folder))
    simulation = bench.simulation
    seeds = count(seed if seed is not None else simulation.seed if simulation else 0)

    def run_on_bench(profile: Profile, place: Path, name: str) -> RunResult:
        return run_profile(bench, profile, place, name, virtual=virtual, seed=next(seeds) if simulation else None)

    allowed = confirm or (lambda profile: simulation is not None or bench.drive is None)
    return investigate_bench(
        profiles, held_out or {}, bench, Path(folder), run_on_bench, allowed,
        lambda: nullcontext(_silent), rounds,
    )  # fmt: skip


def _silent(task: str, share: float | None = None) -> None:
    """Ignore progress."""


def _given(recordings: Recording | Sequence[Recording], what_for: str) -> Sequence[Recording]:
    given = _sequence(recordings)
    if not given:
        raise InputError(f"recordings: given none, allowed one or more; give the recordings to {what_for}")
    return given


def _sequence(recordings: Recording | Sequence[Recording]) -> Sequence[Recording]:
    return recordings if isinstance(recordings, Sequence) else (recordings,)
