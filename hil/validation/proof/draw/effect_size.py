"""Size of an effect: its change of the recordings that no nominal parameter can imitate, in units of the noise.

    size = max over channels of rms( (1 - P) (r_with - r_without) ),   P = Q Q^T of the parameters' sensitivities

Large changes of the parameters are taken into account by a few chord steps: r_without is simulated again at the
parameters to which P leads.

Runs of the closed loop without sensor noise. Channels: torque over the torque's noise; drive (torque less command) and
controller (command less the law fed with the recorded positions) over the same; table less r x motor over the noise of
counting. Independent of twin and diagnosis.
"""

from collections.abc import Mapping, Sequence
from math import inf

import numpy as np
from scipy.optimize import least_squares

from drivers.sim.axis import AxisTruth
from drivers.sim.effects import Effect
from drivers.sim.reality import record
from drivers.sim.sensors import Sensors
from hil.arrays import FloatArray
from hil.control import cascade
from hil.motion.trajectory import Trajectory
from hil.validation.proof.draw.axes import STEP_S, DrawnAxis

_PERFECT = Sensors(motor_counts_per_rev=0, table_resolution_m=0, torque_noise_n_m=0)
_DIFFERENCE = 0.01  # relative, of a parameter in its finite difference
_FACTORS = (0.2, 5.0)  # bounds of fitted parameters, relative to the true value
_CHORDS = 3  # steps of the fit with the derivatives at the true values
# Parameters that a recording shows directly; a change by one percent makes another effect.
_READ_OFF = ("cycles_per_rev", "period_m", "start_s", "end_s")


class EffectSizes:
    """Sizes of effects on one axis over some motions. Simulated runs are kept, since many draws share them."""

    def __init__(self, axis: DrawnAxis, motions: Sequence[Trajectory]) -> None:
        self.axis, self.motions = axis, tuple(motions)
        self._runs: dict[object, FloatArray] = {}
        self._bases: dict[object, tuple[FloatArray, FloatArray]] = {}

    def size(self, effects: Sequence[Effect], beside: Sequence[Effect] = ()) -> float:
        """Return the size of effects beside others, whose parameters can be fitted too."""
        return max(self.sizes(effects, beside).values())

    def sizes(self, effects: Sequence[Effect], beside: Sequence[Effect] = ()) -> dict[str, float]:
        """Return the size in each channel."""
        seen = self._channels([*beside, *effects])
        if not np.all(np.isfinite(seen)):
            return dict.fromkeys(self._names, inf)
        left = self._left(seen, self._channels(beside), tuple(beside))
        if not beside:
            left = self._refitted(seen, left)
        return dict(zip(self._names, np.sqrt(np.mean(left**2, axis=1)).tolist(), strict=True))

    def _left(self, seen: FloatArray, without: FloatArray, beside: tuple[Effect, ...] = ()) -> FloatArray:
        """Return the part of the change of channels (channels, n) that is orthogonal to the sensitivities."""
        basis, _ = self._basis(beside)
        flat = (seen - without).ravel()
        return np.asarray((flat - basis @ (basis.T @ flat)).reshape(seen.shape), dtype=np.float64)

    def _refitted(self, seen: FloatArray, best: FloatArray) -> FloatArray:
        """Return the smallest remainder (channels, n) while the nominal parameters are fitted to the channels."""
        _, slopes = self._basis(())
        factors, at = np.ones(len(self.axis.nominal)), self._channels(())
        for _ in range(_CHORDS):
            step, *_ = np.linalg.lstsq(slopes, (seen - at).ravel(), rcond=None)
            factors = np.clip(factors + _DIFFERENCE * step, *_FACTORS)
            there = {name: self.axis.true[name] * value for name, value in zip(self.axis.nominal, factors, strict=True)}
            at = self._seen_all((), self.axis.with_parameters(there))
            if not np.all(np.isfinite(at)):
                break
            left = self._left(seen, at)
            if np.sum(left**2) >= np.sum(best**2):
                break
            best = left
        return best

    def evidence(self, effects: Sequence[Effect]) -> float:
        """Return the sum of squares over all rows, the statistic of a test on white noise."""
        rows = sum(len(motion) for motion in self.motions)
        return rows * sum(size**2 for size in self.sizes(effects).values())

    def separation(self, effect: Effect, rival: Effect, enough: float) -> float:
        """Return the sum of squares between an effect and a rival that is fitted to it, with the nominal parameters.

        The rival is not fitted if the sum is below `enough` as it stands.
        """
        seen = self._channels([effect])
        at = self._channels([rival]) - seen
        if float(np.sum(at**2)) < enough:
            return float(np.sum(at**2))
        nominal = self.axis.nominal
        own = [name for name, value in rival.parameters.items() if value != 0.0 and name not in _READ_OFF]

        def left(x: FloatArray) -> FloatArray:
            true = {name: self.axis.true[name] * value for name, value in zip(nominal, x, strict=False)}
            mine = {name: rival.parameters[name] * value for name, value in zip(own, x[len(nominal) :], strict=True)}
            other = Effect(rival.id, {**rival.parameters, **mine}, rival.form)
            difference = self._seen_all([other], self.axis.with_parameters(true)) - seen
            return np.asarray(np.nan_to_num(difference, nan=1e6, posinf=1e6, neginf=-1e6).ravel())

        start = np.ones(len(nominal) + len(own))
        return 2.0 * float(least_squares(left, start, bounds=_FACTORS, diff_step=1e-3, max_nfev=6).cost)

    def peak_torque(self) -> float:
        """Return the largest torque of the motions without effects."""
        return max(
            float(np.max(np.abs(rows["force_n" if self.axis.truth.linear else "torque_n_m"])))
            for rows in (self._record(self.axis.truth, (), motion) for motion in self.motions)
        )

    @property
    def _names(self) -> tuple[str, ...]:
        names = ("torque", "drive", "controller", "transmission")
        return names if self.axis.has_table else names[:3]

    def _basis(self, beside: tuple[Effect, ...]) -> tuple[FloatArray, FloatArray]:
        """Return an orthonormal basis (n, p) of the sensitivities of the nominal parameters and those of other effects,
        and the sensitivities (n, p)."""
        key = _key(beside)
        if key not in self._bases:
            at = self._channels(beside).ravel()
            slopes = []
            for name in self.axis.nominal:
                changed = self.axis.with_parameters({name: self.axis.true[name] * (1.0 + _DIFFERENCE)})
                slopes.append(self._channels(beside, changed).ravel() - at)
            for index, effect in enumerate(beside):
                for other in _neighbours(effect):
                    slopes.append(self._channels([*beside[:index], other, *beside[index + 1 :]]).ravel() - at)
            columns = np.nan_to_num(np.stack(slopes, axis=1))
            length = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            self._bases[key] = np.linalg.qr(columns / length)[0], columns
        return self._bases[key]

    def _channels(self, effects: Sequence[Effect], truth: AxisTruth | None = None) -> FloatArray:
        """Return the channels over their noise (channels, n), the motions one after the other."""
        key = (_key(effects), truth)
        if key not in self._runs:
            self._runs[key] = self._seen_all(effects, truth or self.axis.truth)
        return self._runs[key]

    def _seen_all(self, effects: Sequence[Effect], truth: AxisTruth) -> FloatArray:
        return np.concatenate([self._seen(self._record(truth, effects, motion)) for motion in self.motions], axis=1)

    def _seen(self, rows: Mapping[str, FloatArray]) -> FloatArray:
        axis, linear = self.axis, self.axis.truth.linear
        gains, noise = axis.bench.gains, axis.sensors.torque_noise_n_m
        motor = rows["motor_position_m" if linear else "motor_position_rad"]
        command = rows["force_command_n" if linear else "torque_command_n_m"]
        torque = rows["force_n" if linear else "torque_n_m"]
        law, _ = cascade.replay(
            gains,
            cascade.init(float(motor[0]), period_s=axis.period_s),
            rows["position_command_m"],
            rows["velocity_command_m_s"],
            motor,
            np.zeros(motor.size),
        )
        channels = [torque / noise, (torque - command) / noise, (command - law) / noise]
        if axis.has_table:
            stretch = rows["table_position_m"] - gains.ratio_m_rad * motor
            channels.append(stretch / axis.table_noise_m)
        return np.stack(channels)

    def _record(self, truth: AxisTruth, effects: Sequence[Effect], motion: Trajectory) -> dict[str, FloatArray]:
        return record(
            truth,
            _PERFECT,
            effects,
            self.axis.servo,
            np.array(motion.position_m),
            np.array(motion.velocity_m_s),
            self.axis.period_s,
            step_s=STEP_S,
        )


def _neighbours(effect: Effect) -> list[Effect]:
    """Return the effect with each of its parameters changed a little."""
    found = []
    for name, value in effect.parameters.items():
        change = _DIFFERENCE if "phase" in name else _DIFFERENCE * value
        if name not in _READ_OFF and change != 0.0:
            found.append(Effect(effect.id, {**effect.parameters, name: value + change}, effect.form))
    return found


def _key(effects: Sequence[Effect]) -> tuple[object, ...]:
    return tuple((effect.id, effect.form, tuple(effect.parameters.items())) for effect in effects)
