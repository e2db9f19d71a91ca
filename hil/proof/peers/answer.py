"""The answers of other methods about one case, which is prepared once for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from time import monotonic

from hil.errors import HilError, InputError
from hil.files.output import write_json
from hil.proof.answer.blind import DIAGNOSIS, ERROR, answered
from hil.proof.peers import METHODS
from hil.proof.peers.case import read_case


def answer_case(case: Path, out: Path, methods: Sequence[str]) -> None:
    """Have a case answered by those methods that have not answered it; preparing it counts as time of each."""
    begin = monotonic()
    todo = [out / name / case.name for name in methods if not answered(out / name / case.name)]
    for answer in todo:
        answer.mkdir(parents=True, exist_ok=True)
    try:
        prepared = read_case(case)
    except Exception as error:
        for answer in todo:
            _fail(answer, error)
        return
    prepared_s = monotonic() - begin
    for answer in todo:
        begin = monotonic()
        try:
            found = METHODS[answer.parent.name](prepared)
        except Exception as error:
            _fail(answer, error)
        else:
            write_json(answer / DIAGNOSIS, found | {"runtime_s": prepared_s + monotonic() - begin})


def _fail(answer: Path, error: Exception) -> None:
    """An answer is owed, and this is a wrong one; but a method that is not installed cannot give any."""
    if isinstance(error, HilError) and not isinstance(error, InputError):
        raise error
    write_json(answer / ERROR, {"kind": type(error).__name__, "error": str(error)})
