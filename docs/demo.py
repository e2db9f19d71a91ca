"""Draw docs/demo.png from the result of `hil demo --effect periodic_lead_error --seed 1 --virtual --out demo`.

python docs/demo.py demo docs/demo.png
"""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import hil

BEFORE, AFTER, NOISE = "#8c8c8c", "#d55e00", "#0072b2"
BINS = 36  # of the angle of the screw


def draw(folder: Path, picture: Path) -> None:
    """Draw the residual of the table on the held-out motion, before and after the diagnosis, over time and angle."""
    recording = hil.read_recording(folder / "prove.parquet")
    bench = hil.load_bench(folder / "bench.diagnosed.yaml")
    result = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    before, after = (hil.compare(recording, twin) for twin in (hil.load_bench("reference"), bench))
    table = [found.blocks[-1] for found in (before, after)]  # transmission and table, fed with the measured motor
    left, right = (1e6 * block.deviation.values for block in table)
    modelled = left - right
    time_s = recording["time_s"]
    turns = before.channel("motor_position").measured / bench.axis.lead_m
    (finding,) = result["missing"]
    amplitude = finding["parameters"]["amplitude_m"]

    figure, (over_time, over_angle) = plt.subplots(1, 2, figsize=(11, 4.3), width_ratios=(1.7, 1), sharey=True)
    noise = 1e6 * table[1].noise
    over_time.plot(
        time_s, left, color=BEFORE, label=f"twin of the bench file: {table[0].deviation.rms * 1e6:.1f} µm rms"
    )
    over_time.plot(
        time_s,
        right,
        color=AFTER,
        lw=1,
        label=f"twin with the finding: {table[1].deviation.rms * 1e6:.2f} µm rms (noise {noise:.2f})",
    )
    over_time.set(xlabel="time [s]", ylabel="table position, measured − twin [µm]", title="Held-out motion")
    where = np.digitize(turns % 1.0, np.linspace(0.0, 1.0, BINS + 1)) - 1
    angle = (np.arange(BINS) + 0.5) * 360.0 / BINS
    moving = np.abs(np.gradient(turns)) > 2e-4
    means = [[np.mean(part[moving & (where == at)]) for at in range(BINS)] for part in (left, modelled)]
    over_angle.plot(angle, means[0], "o", ms=5, color=NOISE, label="measured − twin of the bench file")
    over_angle.plot(angle, means[1], color=AFTER, label="modelled by the finding")
    over_angle.set(xlabel="angle of the screw [deg]", title="Over the angle of the screw", xticks=range(0, 361, 90))
    low, high = min(np.min(left), -noise), np.max(left)
    for axes in (over_time, over_angle):
        axes.grid(alpha=0.3)
        axes.set_ylim(low - 1.0, high + 0.45 * (high - low))
        axes.legend(loc="upper left", fontsize=10.5, framealpha=1.0)
    figure.suptitle(
        f"Diagnosis: periodic lead error, {1e6 * amplitude['value']:.2f} ± {1e6 * amplitude['std']:.2f} µm once per "
        f"revolution of the screw (confidence {finding['confidence']:.2f})",
        fontsize=13,
    )
    figure.tight_layout()
    figure.savefig(picture, dpi=100)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
