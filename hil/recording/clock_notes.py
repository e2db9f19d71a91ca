"""Notes of a recording on its clock: gaps, jitter of the stamps, missing rows, rows taken at uneven times."""

from hil.arrays import FloatArray
from hil.recording.row_clock import CLOCK_TOLERANCE, RowClock

LEAST_ROWS = 50  # of a part: fewer show no motion


def of_gaps(time_s: FloatArray, pieces: list[slice], kept: list[slice], typical: float) -> tuple[str, ...]:
    """Notes on the gaps, and on parts that are too short."""
    if len(pieces) == 1:
        return ()
    gaps = [float(time_s[piece.start] - time_s[piece.start - 1]) for piece in pieces[1:]]
    sizes = (
        f"a gap of {gaps[0]:.4g} s" if len(gaps) == 1 else f"{len(gaps)} gaps of {min(gaps):.4g} to {max(gaps):.4g} s"
    )
    starts = ", ".join(f"{time_s[piece.start] - time_s[0]:.4g}" for piece in kept[:10])
    text = (
        f"clock: {sizes} between steps of {typical:.4g} s, first after row {pieces[1].start} of the numbers: cut into "
        f"{len(kept)} part{'s' if len(kept) > 1 else ''}, from {starts}{', ...' if len(kept) > 10 else ''} s on"
    )
    lost = sum(piece.stop - piece.start for piece in pieces) - sum(piece.stop - piece.start for piece in kept)
    return (text + (f"; {lost} rows in parts of less than {LEAST_ROWS} are left out" if lost else ""),)


def of_uneven(within: FloatArray, typical: float, told: bool, rate_hz: float) -> str:
    """Note on rows that are interpolated by their stamps."""
    doubt = "" if told else ", and the motion does not tell whether the rows are equal ticks"
    return (
        f"clock: the steps of the stamps are uneven, typically {span_text(typical)}, from {span_text(within.min())} to "
        f"{span_text(within.max())}{doubt}; the channels are interpolated by the stamps to {rate_hz:.6g} Hz"
    )


def of_ticks(clock: RowClock, rate_hz: float | None) -> tuple[str, ...]:
    """Notes on rows that are counted: jitter of the stamps, missing rows, and another rate that the map wants."""
    notes, missing = [], clock.missing
    if clock.rounded is not None:
        notes.append(
            f"clock: the stamps are rounded to {span_text(clock.rounded.digit_s)}; by all of them rows are equal ticks "
            f"of {span_text(clock.period_s)} +- {span_text(clock.rounded.error_s)}"
        )
    elif clock.jitter_s > CLOCK_TOLERANCE * clock.period_s:
        notes.append(
            f"clock: the stamps jitter by {span_text(clock.jitter_s)}, but the rows are equal ticks of "
            f"{span_text(clock.period_s)}: the row number is the clock"
        )
    if missing:
        notes.append(
            f"clock: {sum(missing)} rows are missing in {len(missing)} place{'s' if len(missing) > 1 else ''} at a "
            f"period of {clock.period_s:.6g} s; they are interpolated"
        )
    if rate_hz is not None:
        notes.append(
            f"clock: the channels are interpolated from ticks of {span_text(clock.period_s)} to {rate_hz:.6g} Hz"
        )
    return tuple(notes)


def span_text(span_s: float) -> str:
    """A span of time in us, ms or s, of four digits."""
    factor, unit = (1e6, "us") if span_s < 1e-3 else (1e3, "ms") if span_s < 1.0 else (1.0, "s")
    return f"{factor * span_s:.4g} {unit}"
