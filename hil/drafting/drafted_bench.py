"""A drafted bench as an object: the bench itself, the text of its file, and what the recordings tell beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from hil.bench.bench_file import Bench, load_bench
from hil.drafting.bench_text import bench_text
from hil.drafting.bench_value import BenchValue
from hil.drafting.draft_bench import BenchDraft, draft_bench
from hil.errors import InputError
from hil.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class DraftedBench:
    """A bench of which nothing was known: `text` is its file, each value with its error and how it was found."""

    draft: BenchDraft
    text: str
    bench: Bench

    @property
    def values(self) -> tuple[BenchValue, ...]:
        """Keys of axis and control law with value, unit and standard error; without a law those of the axis."""
        return (*self.draft.axis.values, *self.draft.control)

    @property
    def notes(self) -> tuple[str, ...]:
        """What the recordings tell beside the keys of the bench."""
        return tuple(self.draft.notes)

    @property
    def unsure(self) -> tuple[str, ...]:
        """What the owner of the axis should check."""
        return tuple(self.draft.unsure)

    def __repr__(self) -> str:
        lines = [f"Drafted bench of {self.draft.name}: {self.draft.axis.model}"]
        lines += [f"  {one.key} = {one.shown}  ({one.error})" for one in self.values]
        lines += [] if self.draft.control else [f"  control: unknown, {self.draft.control_why}"]
        lines += [f"  {note}" for note in self.notes]
        return "\n".join([*lines, *(f"  please check: {note}" for note in self.unsure)])


def drafted(recordings: Sequence[Recording]) -> DraftedBench:
    """Draft the bench of one axis, and check its file.

    Raises InputError for recordings that do not tell masses and friction, or whose draft is no valid bench.
    """
    draft = draft_bench(*recordings)
    text = bench_text(draft)
    with TemporaryDirectory() as folder:
        written = Path(folder) / "bench.yaml"
        written.write_text(text, encoding="utf-8")
        try:
            return DraftedBench(draft, text, load_bench(written))
        except InputError as error:
            told = str(error).replace(f"{folder}/", "")
            raise InputError(f"the draft is no valid bench, and is not written: {told}") from None
