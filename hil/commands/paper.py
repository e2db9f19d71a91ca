"""hil paper."""

from hil.commands.options import Out
from hil.report.console import out, progress


def paper(
    folder: Out = None,
) -> None:
    """Reproduce the source paper: printed and computed values, reasons for differences, and its figures."""
    from hil.commands.warm_up import compile_kernels
    from hil.files.output import default_folder, new_folder
    from hil.validation.paper import run_paper
    from hil.validation.paper.report import verdict, write_paper

    folder = folder or default_folder("paper")
    compile_kernels()
    with new_folder(folder) as part, progress() as tell:
        tell("computing the paper")
        result = run_paper(part)
        write_paper(result, part)
    out.print(f"{verdict(result)}\n\nReport: {folder / 'paper.html'}")
