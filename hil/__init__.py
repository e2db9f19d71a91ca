"""Real-time servo control, digital twin and diagnosis of missing physics for ball-screw and linear axes.

    import hil

    bench = hil.load_bench("reference")
    trajectory = hil.plan(hil.load_profile("reference"), bench.period_s)
    recording = hil.simulate(bench, trajectory)
    print(hil.compare(recording, bench))
    print(hil.diagnose(recording, bench))

All public names; every other name may change without notice. `help(hil.compare)` tells arguments, units and errors.

Benches and motions
    load_bench         a bench file, or a shipped bench by its name
    load_profile       a profile file: limits and segments of a motion
    plan               set-points of every tick, from a profile
Recordings
    simulate           run a trajectory on the simulated axis of a bench
    run                run a profile on real or simulated hardware
    read_recording     a recording from its file
    draft_map          the map of a foreign file: which column is what
    import_recording   a recording from a foreign file, by a map
Twin and axis
    identify           the bench of an axis, drafted from its recordings alone
    compare            measured against twin, in closed loop and block by block
    fit_nominal        masses, stiffness and friction, fitted to recordings
    identify_friction  friction from constant feeds, with standard errors
    frf                frequency responses of plant and loops beside the twin, with stability margins
    positioning_accuracy, circular_accuracy   figures of ISO 230-2 and of ISO 230-4
Missing physics
    diagnose           which physics the twin lacks
    explain            from files to a diagnosis and its page in one step
    design_experiment  the motion that separates causes which are open
    investigate        run, diagnose, run the designed motion, repeat
    register           add a mechanism of your own to the library
Files
    save               write any of these to a file; its ending says the form
Objects
    Bench, Profile, Trajectory, Recording, Twin, Mechanism, LIBRARY, Comparison, FrequencyResponse,
    PositioningAccuracy, CircularAccuracy, Diagnosis, Verdict
Errors
    HilError, and of its kind InputError (a file or argument) and FieldError (a value in a model)
"""

from __future__ import annotations

import sys as _sys
from contextlib import suppress as _suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any

from hil.compiled.kernel_cache import provide_kernel_cache as _provide_kernel_cache
from hil.errors import HilError as _HilError

if TYPE_CHECKING:
    from hil.api import (
        design_experiment,
        diagnose,
        fit_nominal,
        identify,
        investigate,
        run,
        simulate,
    )
    from hil.bench.bench_file import Bench, load_bench
    from hil.diagnosis.diagnosis import Diagnosis
    from hil.diagnosis.result import Verdict
    from hil.errors import FieldError, HilError, InputError
    from hil.explanation import explain
    from hil.frequency.measure import frf
    from hil.frequency.result import FrequencyResponse
    from hil.identification.compare import Comparison, compare
    from hil.identification.friction import identify_friction
    from hil.importing.by_map import import_recording
    from hil.importing.draft_map import draft_map
    from hil.motion.profile import Profile, load_profile
    from hil.motion.trajectory import Trajectory, plan
    from hil.positioning.accuracy import PositioningAccuracy, positioning_accuracy
    from hil.positioning.circle import CircularAccuracy, circular_accuracy
    from hil.recording.recording import Recording, read_recording
    from hil.report.saving import save
    from hil.twin.axis import Twin
    from hil.twin.library import LIBRARY, register
    from hil.twin.mechanism import Mechanism

__version__ = "0.4.0"

with _suppress(_HilError):  # raised again when a kernel is needed
    _provide_kernel_cache()  # before any module imports numba

_MODULE_OF = {
    # verbs
    "load_bench": "hil.bench.bench_file",
    "load_profile": "hil.motion.profile",
    "plan": "hil.motion.trajectory",
    "simulate": "hil.api",
    "run": "hil.api",
    "read_recording": "hil.recording.recording",
    "draft_map": "hil.importing.draft_map",
    "import_recording": "hil.importing.by_map",
    "identify": "hil.api",
    "compare": "hil.identification.compare",
    "fit_nominal": "hil.api",
    "identify_friction": "hil.identification.friction",
    "frf": "hil.frequency.measure",
    "positioning_accuracy": "hil.positioning.accuracy",
    "circular_accuracy": "hil.positioning.circle",
    "diagnose": "hil.api",
    "explain": "hil.explanation",
    "design_experiment": "hil.api",
    "investigate": "hil.api",
    "register": "hil.twin.library",
    "save": "hil.report.saving",
    # nouns
    "Bench": "hil.bench.bench_file",
    "Profile": "hil.motion.profile",
    "Trajectory": "hil.motion.trajectory",
    "Recording": "hil.recording.recording",
    "Twin": "hil.twin.axis",
    "Mechanism": "hil.twin.mechanism",
    "LIBRARY": "hil.twin.library",
    "Comparison": "hil.identification.compare",
    "FrequencyResponse": "hil.frequency.result",
    "PositioningAccuracy": "hil.positioning.accuracy",
    "CircularAccuracy": "hil.positioning.circle",
    "Diagnosis": "hil.diagnosis.diagnosis",
    "Verdict": "hil.diagnosis.result",
    # errors
    "HilError": "hil.errors",
    "InputError": "hil.errors",
    "FieldError": "hil.errors",
}

__all__ = [  # noqa: RUF022  (in the order of use, as in the documentation)
    "load_bench",
    "load_profile",
    "plan",
    "simulate",
    "run",
    "read_recording",
    "draft_map",
    "import_recording",
    "identify",
    "compare",
    "fit_nominal",
    "identify_friction",
    "frf",
    "positioning_accuracy",
    "circular_accuracy",
    "diagnose",
    "explain",
    "design_experiment",
    "investigate",
    "register",
    "save",
    "Bench",
    "Profile",
    "Trajectory",
    "Recording",
    "Twin",
    "Mechanism",
    "LIBRARY",
    "Comparison",
    "FrequencyResponse",
    "PositioningAccuracy",
    "CircularAccuracy",
    "Diagnosis",
    "Verdict",
    "HilError",
    "InputError",
    "FieldError",
    "__version__",
]


def __getattr__(name: str) -> Any:
    """Import a public name on first use. Raises AttributeError for a name that is not public."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'hil' has no attribute {name!r}")
    _provide_kernel_cache()
    value = getattr(import_module(_MODULE_OF[name]), name)
    if name != "LIBRARY":  # `register` makes another one
        globals()[name] = value
    return value


def __dir__() -> list[str]:
    """All public names. pydoc gets none, through inspect: help(hil) is the text above, which lists them, instead of
    two thousand lines with every inherited member."""
    frame = _sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__") == "inspect":
        frame = frame.f_back
    return [] if frame.f_globals.get("__name__") == "pydoc" else sorted({*globals(), *__all__})
