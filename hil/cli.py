"""The program `hil`.

Exit codes: 0 done, 1 something went wrong that the user can act on, 2 a file or an argument is wrong, 130 stopped by
ctrl-C. An expected error is one message on stderr; a Python traceback means a defect of the program.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from hil.commands.bench import bench
from hil.commands.compare import compare
from hil.commands.compensate import compensate
from hil.commands.demo import demo
from hil.commands.diagnose import diagnose
from hil.commands.doctor import doctor
from hil.commands.explain import explain
from hil.commands.export import export
from hil.commands.fleet import fleet
from hil.commands.frf import frf
from hil.commands.friction import friction
from hil.commands.guide import guide
from hil.commands.identify import identify
from hil.commands.import_ import import_
from hil.commands.install_service import install_service
from hil.commands.investigate import investigate
from hil.commands.iso230 import iso230
from hil.commands.latency import latency
from hil.commands.paper import paper
from hil.commands.prove import prove
from hil.commands.recover import recover
from hil.commands.run import run
from hil.commands.scope import scope
from hil.commands.validate import validate
from hil.commands.warm_up import warm_up
from hil.compiled.kernel_cache import provide_kernel_cache
from hil.errors import HilError
from hil.files.optional_library import how_to_install


class _Commands(TyperGroup):
    """The commands with the whole first paragraph of their help, which click would cut to one line."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        rows = [(name, " ".join((one.help or "").split("\n\n")[0].split())) for name, one in self.commands.items()]
        with formatter.section("Commands"):
            formatter.write_dl(rows)


# Without Rich's markup: it would eat words in square brackets, such as [m], and its import takes 0.2 s.
app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Servo bench: real-time control, digital twin, comparison and diagnosis of recordings.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from hil.commands.version import version_line

        print(version_line())
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print release and commit.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    """Options of the program itself."""


# In the order of --help. A command's file imports nothing heavy at its top.
COMMANDS: tuple[tuple[str, Callable[..., Any]], ...] = (
    ("guide", guide),
    ("demo", demo),
    ("run", run),
    ("scope", scope),
    ("recover", recover),
    ("explain", explain),
    ("import", import_),
    ("export", export),
    ("identify", identify),
    ("compare", compare),
    ("diagnose", diagnose),
    ("compensate", compensate),
    ("investigate", investigate),
    ("fleet", fleet),
    ("friction", friction),
    ("frf", frf),
    ("iso230", iso230),
    ("paper", paper),
    ("prove", prove),
    ("validate", validate),
    ("bench", bench),
    ("warm-up", warm_up),
    ("latency", latency),
    ("doctor", doctor),
    ("install-service", install_service),
)
for _name, _command in COMMANDS:
    app.command(_name)(_command)


def main() -> None:
    """Entry point: runs the command line, turns errors into a message and an exit code."""
    _open_standard_streams()
    try:
        # commands spread their work over the cores themselves; threads of the linear algebra would slow them down
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        provide_kernel_cache()
        try:
            app()
        finally:
            if sys.stdout:
                sys.stdout.flush()  # a full disk shows here, not when the interpreter ends
    except SystemExit as end:
        if end.code == 130:
            print("stopped by ctrl-C", file=sys.stderr)
        raise
    except HilError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
    except KeyboardInterrupt:
        print("stopped by ctrl-C", file=sys.stderr)
        sys.exit(130)
    except ModuleNotFoundError as error:
        if not (told := how_to_install(error)):
            raise
        print(told, file=sys.stderr)
        sys.exit(2)
    except OSError as error:
        if error.errno in (errno.ENAMETOOLONG, errno.EACCES, errno.ELOOP, errno.ENOTDIR) and error.filename:
            print(f"{error.filename}: cannot be used ({error.strerror}); give another path", file=sys.stderr)
            sys.exit(2)
        if error.errno not in (errno.ENOSPC, errno.EPIPE, errno.EIO):  # EIO: a terminal that is closed
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is buffered cannot be written
        if error.errno == errno.ENOSPC:
            print(f"{error.filename or 'output'}: no space left on the device; make room", file=sys.stderr)
        sys.exit(1)


def _open_standard_streams() -> None:
    """Open /dev/null for each closed one of stdin, stdout and stderr, so that no other file gets its number."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


if __name__ == "__main__":
    main()
