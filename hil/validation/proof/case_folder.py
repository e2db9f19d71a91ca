"""The folder of the cases of a proof."""

from pathlib import Path

from hil.errors import InputError


def cases_in(folder: Path, answers: Path) -> list[Path]:
    """Return the cases of a folder in order of their names; makes the folder of their answers.

    Raises InputError if there are none, or if the folder cannot be made.
    """
    if not any(folder.glob("*/bench.yaml")):
        raise InputError(f"{folder}: holds no cases, allowed the folder of cases of a proof, DIR/cases")
    try:
        answers.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{answers}: cannot be made ({error.strerror}); give another folder") from None
    return sorted(folder.iterdir())
