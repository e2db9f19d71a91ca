"""Write the files of controllers beside a bench file."""

from collections.abc import Callable, Iterable
from pathlib import Path

from hil.bench.bench_file import Bench
from hil.compensating.controllers import Controller
from hil.compensating.controllers.cia402 import for_cia402
from hil.compensating.controllers.controller_task import ControllerFiles, ControllerTask
from hil.compensating.controllers.linuxcnc import for_linuxcnc
from hil.compensating.controllers.plain_csv import for_csv
from hil.compensating.controllers.sinumerik import for_sinumerik
from hil.compensating.controllers.twincat import for_twincat
from hil.compensating.derive import reach_of
from hil.control.compensation_tables import Compensation
from hil.errors import InputError
from hil.files.input_file import is_file
from hil.files.output import write_text
from hil.motion.trajectory import Trajectory

WRITERS: dict[Controller, Callable[[ControllerTask], ControllerFiles]] = {
    Controller.LINUXCNC: for_linuxcnc,
    Controller.SINUMERIK: for_sinumerik,
    Controller.TWINCAT: for_twincat,
    Controller.CIA402: for_cia402,
    Controller.CSV: for_csv,
}


def controller_files(
    controllers: Iterable[Controller], bench: Bench, compensation: Compensation, motion: Trajectory, target: Path
) -> dict[Controller, ControllerFiles]:
    """Texts for each controller; files are named by the stem of `target`. Raises HilError as the writers do."""
    reach, drive = reach_of(bench, motion), bench.drive
    task = ControllerTask(
        target.stem,
        compensation,
        bench.gains,
        motion,
        reach.low_m,
        reach.high_m,
        bench.axis.turns,
        bench.axis.drive_unit,
        drive.rated_torque_n_m if drive is not None else None,
    )
    return {controller: WRITERS[controller](task) for controller in dict.fromkeys(controllers)}


def path_of(target: Path, ending: str) -> Path:
    """File of an ending beside the bench file `target`. Raises InputError if it exists."""
    path = target.with_name(f"{target.stem}.{ending}")
    if is_file(path):
        raise InputError(f"{path}: the file exists and is not overwritten; give another name with --out or remove it")
    return path


def write_files(files: Iterable[ControllerFiles], target: Path) -> list[Path]:
    """Write all files; none if one of them exists."""
    texts = {path_of(target, ending): text for one in files for ending, text in one.texts.items()}
    for path, text in texts.items():
        write_text(path, text)
    return list(texts)
