"""Windows of one case: places in its record, seen by sensors with fresh noise, and what happens there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.datasets.columns import OF_REVOLUTIONS
from postproc.signals.sensors import Clock
from postproc.store.run_ups import is_run_up

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import xarray as xr
    from numpy.typing import NDArray

    from postproc.signals.sensors import Sensor


@dataclass(frozen=True, kw_only=True)
class Windows:
    """How windows are made of a case."""

    sensors: Mapping[str, Sensor]  # what the signal of a column is seen by
    reference: Mapping[str, float]  # white noise at level 1, rms in its unit; none where sensors have noise
    levels: tuple[float, ...]  # of the noise; none where sensors have noise of their own
    n_draw: int  # windows of a case at each level
    n_sample: int  # of a window
    rate: float  # Hz
    seed: int  # of places and noise

    def of_case(
        self, case: xr.Dataset, waves: Mapping[str, NDArray[np.floating[Any]]], force: NDArray[Any], key: int
    ) -> Iterator[dict[str, Any]]:
        """Yield the windows of a loaded case as rows, by column.

        `waves` are its signals by column, (n_sample,); `force` is that of all stators, (n_stator, n_sample),
        N; `key`, with the seed, decides places and noise.
        """
        clock = Clock(case, self.rate)
        seen = {name: clock.before_converter(waves[name], sensor) for name, sensor in self.sensors.items()}
        pulses = clock.pulses()
        touches = np.any(force > 0, axis=0)
        for level in self.levels or (None,):
            for draw in range(self.n_draw):
                at = f"{level} {draw} ".encode()
                places = np.random.default_rng([self.seed, key, *at])
                first = int(places.integers(0, clock.time.size - self.n_sample + 1))
                window = slice(first, first + self.n_sample)
                begin, end = clock.turns[first], clock.turns[first + self.n_sample - 1]
                samples = slice(int(begin * clock.per_revolution), int(end * clock.per_revolution) + 1)
                row: dict[str, Any] = {"draw": draw, "start": clock.time[first], "rate": self.rate}
                if level is not None:
                    row["noise"] = level
                for name, given in self.sensors.items():
                    sensor = given if level is None else replace(given, white=level * self.reference[name])
                    rng = np.random.default_rng([self.seed, key, *at, *name.encode()])
                    row[name] = sensor.after_clock(seen[name][window], rng).astype(np.float32)
                row["key_phasor"] = pulses[window].astype(np.float32)
                row["contact"] = bool(touches[samples].any())
                row["window_contact_fraction"] = float(touches[samples].mean())
                if is_run_up(case):
                    row |= _of_revolutions(case, begin, end, (self.n_sample - 1) / self.rate)
                yield row


def _of_revolutions(case: xr.Dataset, begin: float, end: float, duration: float) -> dict[str, float]:
    """Mean speed of a window of a run-up, and labels of its revolutions at the worst stator."""
    turned = slice(int(begin), int(end) + 1)
    found = {"spin_speed": 2.0 * math.pi * (end - begin) / duration}
    for name, (stored, _) in OF_REVOLUTIONS.items():
        if stored in case:
            values = case[stored].transpose(..., "revolution").values[..., turned]
            over = values.max(axis=-1) if name == "peak_contact_force" else values.mean(axis=-1)
            found[name] = float(over.max())
    return found
