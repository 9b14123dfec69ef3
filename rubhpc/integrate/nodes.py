"""Reads what the exact integrator kept: samples, extrema, contact forces, energies, in whole blocks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rubhpc.kernels import phases as kernel
from rubhpc.kernels.observe import (
    DAMPING_LOSS,
    DRIVE_WORK,
    FRICTION_LOSS,
    TWIST_ACCELERATION,
    UNBALANCE_WORK,
    Samples,
    Tally,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]

ROOM = 8192  # instants a kernel call may keep
LOOKS_A_REVOLUTION = 128  # at the power of damping and unbalance


class NodeReader:
    """Turns modal coordinates at the nodes into a case's samples and tally."""

    def __init__(self, phases: kernel.Phases, bodies: kernel.Reduced, clock: kernel.Clock) -> None:
        """Take the tables of one case; the first read begins its record."""
        self.phases, self._bodies, self._clock = phases, bodies, clock
        self.nodes = _room(phases.switch_re.shape[2])
        self.greatest = 0.0  # m, displacement of output node or stator tips at a sample
        self._last_outputs: Floats | None = None

    def widen(self, phases: kernel.Phases) -> None:
        """Take tables to which phases were added; the last node read stays."""
        old, self.phases = self.nodes, phases
        self.nodes = _room(phases.switch_re.shape[2])
        for name in ("tick", "phase", "is_sample", "is_entry"):
            getattr(self.nodes, name)[0] = getattr(old, name)[0]
        self.nodes.z[0, :, : old.z.shape[2]] = old.z[0]

    def read(self, n_node: int, samples: Samples, tally: Tally) -> int:
        """Measure the first `n_node` nodes; returns how many the buffer still holds (the last one)."""
        if n_node:
            phase, is_sample = self.nodes.phase[:n_node], self.nodes.is_sample[:n_node]
            self._read_samples(np.flatnonzero(is_sample), samples, tally)
            for p in _present(phase):
                if self.phases.mask[p]:
                    self._read_contact(p, n_node, samples, tally)
            for field in self.nodes:
                field[0] = field[n_node - 1]
            self.nodes.is_sample[0] = False  # it is read
        return min(n_node, 1)

    def _values(self, re: Floats, im: Floats, at: Ints) -> Floats:
        """Values at some nodes, (node, rows), of the rows (p, rows, m) of a table."""
        z = self.nodes.z.reshape(ROOM, -1)
        phase = self.nodes.phase[at]
        values = np.empty((at.size, re.shape[1]))
        for p in _present(phase):
            chosen = np.flatnonzero(phase == p)
            values[chosen] = z[at[chosen]] @ np.hstack([re[p], -im[p]]).T
        return values

    def _read_samples(self, at: Ints, samples: Samples, tally: Tally) -> None:
        clock, n_sample = self._clock, samples.rotor.shape[1]
        if not at.size:
            return
        i_sample = self.nodes.tick[at] // clock.ticks_per_sample
        output = self._values(self.phases.output_re, self.phases.output_im, at)
        inside = i_sample < n_sample
        where, kept = i_sample[inside], output[inside]
        samples.rotor[:3, where] = kept[:, :3].T
        samples.rotor[TWIST_ACCELERATION, where] += kept[:, kernel.TWIST_ACCELERATION_ROW]
        samples.axial[:, where] = kept[:, kernel.N_ROTOR_ROW :: 3].T
        samples.lateral[:, where] = kept[:, kernel.N_ROTOR_ROW + kernel.LATERAL_ROW :: 3].T

        tips = output[:, kernel.N_ROTOR_ROW :].reshape(output.shape[0], -1, 3)[:, :, :2]
        self.greatest = max(self.greatest, float(np.abs(output[:, :2]).max()), float(np.abs(tips).max()))
        if self._last_outputs is not None:
            output = np.vstack([self._last_outputs, output])
        self._last_outputs = output[-1]
        interval = clock.tick * clock.ticks_per_sample
        for k in range(3):
            low, high = _extrema(output[:, k], output[:, 3 + k], interval)
            tally.lowest[k], tally.highest[k] = min(tally.lowest[k], low), max(tally.highest[k], high)
        for i in range(tally.peak_lateral.size):
            first = kernel.N_ROTOR_ROW + 3 * i
            tip, rate = output[:, first + kernel.LATERAL_ROW], output[:, first + kernel.LATERAL_RATE]
            low, high = _extrema(tip, rate, interval)
            tally.peak_lateral[i] = max(tally.peak_lateral[i], -low, high)

        stride = max(1, clock.samples_per_revolution // LOOKS_A_REVOLUTION)
        looks = (i_sample % stride == 0) & (i_sample <= n_sample)
        at, i_sample = at[looks], i_sample[looks]
        weight = stride * interval * np.where((i_sample == 0) | (i_sample == n_sample), 0.5, 1.0)
        self._read_energy(at, weight, tally)

    def _read_energy(self, at: Ints, weight: Floats, tally: Tally) -> None:
        """Work of damping and unbalance; `weight` (s) is the time that each look stands for."""
        bodies, clock = self._bodies, self._clock
        motion_re, motion_im, n = self.phases.motion_re, self.phases.motion_im, bodies.push.shape[1]
        velocity = self._values(motion_re[:, n:], motion_im[:, n:], at)
        loss = np.einsum("kn,kn->k", velocity, velocity @ bodies.damping.T)
        if np.any(bodies.circulation):
            displacement = self._values(motion_re[:, :n], motion_im[:, :n], at)
            loss += np.einsum("kn,kn->k", velocity, displacement @ bodies.circulation.T)
        per_revolution = clock.ticks_per_sample * clock.samples_per_revolution
        angle = np.copysign(2.0 * np.pi, clock.spin) * (self.nodes.tick[at] % per_revolution) / per_revolution
        power = np.cos(angle) * (velocity @ bodies.force_cosine)
        power += np.sin(angle) * (velocity @ bodies.force_sine)
        tally.energy[DAMPING_LOSS] += weight @ loss
        tally.energy[UNBALANCE_WORK] += weight @ power

    def _read_contact(self, p: int, n_node: int, samples: Samples, tally: Tally) -> None:
        """Forces of the pairs closed in phase p: cubics between nodes, Simpson's rule for friction."""
        nodes, clock, bodies = self.nodes, self._clock, self._bodies
        phase, tick = nodes.phase[:n_node], nodes.tick[:n_node]
        joined = (phase[:-1] == p) & (phase[1:] == p) & (tick[1:] > tick[:-1]) & ~nodes.is_entry[1:n_node]
        first = np.flatnonzero(joined)
        if not first.size:
            return
        step = np.multiply(tick[first + 1] - tick[first], clock.tick, dtype=np.float64)
        i_sample = tick[first] // clock.ticks_per_sample
        interval = clock.tick * clock.ticks_per_sample
        tables, q = self.phases, bodies.radius.size
        rows_re = np.concatenate([tables.switch_re, tables.rate_re, tables.slip_re], axis=1)
        rows_im = np.concatenate([tables.switch_im, tables.rate_im, tables.slip_im], axis=1)
        inside = np.flatnonzero(phase == p)
        value = self._values(rows_re, rows_im, inside)
        place = np.searchsorted(inside, first)
        begin, end = value[place], value[place + 1]  # of the steps: force, slope and slip of every pair
        for i in range(bodies.radius.size):
            if not int(self.phases.mask[p]) >> i & 1:
                continue
            before, after = begin[:, i], end[:, i]
            bend = step * (begin[:, q + i] - end[:, q + i])
            impulse = 0.5 * step * (before + after) + step * bend / 12.0
            middle = 0.5 * (before + after) + 0.125 * bend
            sliding = begin[:, 2 * q + i], end[:, 2 * q + i]
            work = before * sliding[0] + 2.0 * middle * (sliding[0] + sliding[1]) + after * sliding[1]
            friction_work = float(bodies.friction[i] * (step @ work) / 6.0)
            _, peak = _cubic_extrema(before, begin[:, q + i], after, end[:, q + i], step)
            np.add.at(samples.force[i], i_sample, impulse / interval)
            tally.contact_time[i] += step.sum()
            tally.impulse[i] += impulse.sum()
            tally.friction_work[i] += friction_work
            tally.least_slip[i] = min(tally.least_slip[i], sliding[0].min(), sliding[1].min())
            tally.peak_force[i] = max(tally.peak_force[i], before.max(), after.max(), peak)
            tally.energy[FRICTION_LOSS] += friction_work
            drive = bodies.friction[i] * bodies.radius[i] * abs(clock.spin)
            tally.energy[DRIVE_WORK] += drive * impulse.sum()


def _present(phase: Ints) -> list[int]:
    """Which phases occur."""
    occurs: list[int] = np.flatnonzero(np.bincount(phase)).tolist() if phase.size else []
    return occurs


def _room(m: int) -> kernel.Nodes:
    return kernel.Nodes(
        tick=np.zeros(ROOM, dtype=np.int64),
        phase=np.zeros(ROOM, dtype=np.int64),
        is_sample=np.zeros(ROOM, dtype=np.bool_),
        is_entry=np.zeros(ROOM, dtype=np.bool_),
        z=np.zeros((ROOM, 2, m)),
    )


def _extrema(value: Floats, rate: Floats, interval: float) -> tuple[float, float]:
    """Least and greatest value of a signal known with its rate at equal intervals (s)."""
    low, high = _cubic_extrema(value[:-1], rate[:-1], value[1:], rate[1:], interval)
    return min(low, float(value.min())), max(high, float(value.max()))


def _cubic_extrema(
    before: Floats, rate_before: Floats, after: Floats, rate_after: Floats, step: Floats | float
) -> tuple[float, float]:
    """Least and greatest value inside steps at whose ends value and rate are known (Hermite's cubic)."""
    turning = rate_before * rate_after < 0.0
    if not turning.any():
        return np.inf, -np.inf
    step = np.broadcast_to(step, before.shape)[turning]
    start, rise = before[turning], (after - before)[turning]
    a, b = rate_before[turning] * step, rate_after[turning] * step
    quadratic, cubic = 3.0 * rise - 2.0 * a - b, a + b - 2.0 * rise
    # Rates of opposite sign: the slope a + 2 quadratic s + 3 cubic s^2 has one root inside. This form of it
    # does not cancel; `a` is not zero here.
    root = np.sqrt(quadratic**2 - 3.0 * cubic * a)
    below = np.sign(a) * root - quadratic
    s = np.divide(a, below, out=np.zeros_like(a), where=below != 0.0)  # zero only by underflow
    value = start + s * (a + s * (quadratic + s * cubic))
    return float(value.min()), float(value.max())
