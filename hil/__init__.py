"""Real-time servo control, digital twin and diagnosis of missing physics for ball-screw and linear axes.

The names of `__all__` are the public API; every other name may change without notice. A name is imported on first
use (PEP 562), so that `import hil` itself loads neither numpy nor scipy:

    import hil

    bench = hil.load_bench("reference")
    trajectory = hil.plan(hil.load_profile("profiles/reference.yaml"), bench.period_s)
    recording = hil.simulate(bench, trajectory)
    print(hil.compare(recording, bench))
    print(hil.diagnose(recording, bench))
"""

from __future__ import annotations

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
        investigate,
        run,
        simulate,
    )
    from hil.bench.bench_file import Bench, load_bench
    from hil.diagnosis.diagnosis import Diagnosis
    from hil.diagnosis.result import Verdict
    from hil.errors import FieldError, HilError, InputError
    from hil.frequency.measure import frf
    from hil.frequency.result import FrequencyResponse
    from hil.identification.compare import Comparison, compare
    from hil.identification.friction import identify_friction
    from hil.importing.by_map import import_recording
    from hil.motion.profile import Profile, load_profile
    from hil.motion.trajectory import Trajectory, plan
    from hil.recording.recording import Recording, read_recording
    from hil.twin.axis import Twin
    from hil.twin.library import LIBRARY
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
    "import_recording": "hil.importing.by_map",
    "compare": "hil.identification.compare",
    "fit_nominal": "hil.api",
    "identify_friction": "hil.identification.friction",
    "frf": "hil.frequency.measure",
    "diagnose": "hil.api",
    "design_experiment": "hil.api",
    "investigate": "hil.api",
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
    "import_recording",
    "compare",
    "fit_nominal",
    "identify_friction",
    "frf",
    "diagnose",
    "design_experiment",
    "investigate",
    "Bench",
    "Profile",
    "Trajectory",
    "Recording",
    "Twin",
    "Mechanism",
    "LIBRARY",
    "Comparison",
    "FrequencyResponse",
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
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
