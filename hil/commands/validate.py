"""hil validate."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from hil.report.console import err, out


class Format(StrEnum):
    """A file format."""

    BENCH = "bench"
    PROFILE = "profile"
    MAP = "map"


def validate(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Bench, profile or map files (YAML).", show_default=False)
    ] = None,
    schema: Annotated[
        Format | None, typer.Option(help="Print the JSON Schema of this format, for editors.", show_default=False)
    ] = None,
) -> None:
    """Check bench, profile and map files, and the EDS files of a bench. Every error names file, line and field."""
    from hil.errors import InputError

    if (schema is None) == (not files):
        raise InputError("FILES: give files to check, or --schema and a format, not both")
    if schema is not None:
        from hil.manual.schemas import schema_text

        out.print(schema_text(schema), end="")
        return
    problems = []
    for path in files or ():
        try:
            out.print(f"{path}: {_checked(path)}")
        except InputError as error:
            problems.append(str(error))
    if problems:
        raise InputError("\n".join(problems))


def _checked(path: Path) -> str:
    """Describe a file: by its keys a profile, a map, else a bench. Raises InputError."""
    from pydantic import BaseModel, ConfigDict

    from hil.files.yaml_model import load_model

    class AnyFile(BaseModel):
        model_config = ConfigDict(extra="allow")

    keys = load_model(path, AnyFile).model_extra or {}
    if keys.keys() & {"segments", "limits"}:
        from hil.motion.profile import load_profile

        profile = load_profile(path)
        duration_s = sum(profile.slots(run.move) for run in profile.runs) * profile.grid_s
        return f"a profile of {len(profile.runs)} moves, {duration_s:.1f} s"
    if "channels" in keys:
        from hil.importing.map_file import RecordingMap

        return f"a map of {len(load_model(path, RecordingMap).channels)} channels"
    return _checked_bench(path)


def _checked_bench(path: Path) -> str:
    from hil.errors import FieldError
    from hil.files.yaml_model import located
    from hil.loop.devices import check_runnable
    from hil.loop.eds_files import check_eds_files
    from hil.loop.simulated_bench import load_simulated

    bench = load_simulated(path)
    if bench.drive is not None or bench.simulation is not None:  # with neither it describes recordings only
        try:
            check_runnable(bench)
            for note in check_eds_files(bench):
                err.print(f"note: {note}")
        except FieldError as error:
            raise located(path, error) from None
    return f"a bench with a {bench.axis.model} axis and {len(bench.mechanisms)} mechanisms"
