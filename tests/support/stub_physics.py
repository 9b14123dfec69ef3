"""A stand-in for the physics, for tests of what becomes of cases whatever their numbers are."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from rubhpc.integrate.record import Record
from rubhpc.running import case_setup, job, worker
from rubhpc.schema import DONE, SECTION_NAMES, SIGNAL_NAMES, VARIABLES, case_measures

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest

    from rubhpc.study.study import Recording


def signals(recording: Recording, value: float) -> dict[str, np.ndarray]:
    n_sample = recording.revolutions * recording.samples_per_revolution
    return {
        name: np.full((1, n_sample) if VARIABLES[name].dims[0] == "stator" else n_sample, value)
        for name in SIGNAL_NAMES
    }


def record(recording: Recording, friction: float, status: int = DONE, reason: str = "") -> Record:
    """A record whose numbers show the friction of its case."""
    waveforms = signals(recording, friction)
    n_order = recording.revolutions * recording.samples_per_revolution // 2 + 1
    return Record(
        status=status,
        reason=reason,
        samples_per_revolution=recording.samples_per_revolution,
        signals=waveforms,
        spectra={f"spectrum_{name}": values[..., :n_order] for name, values in waveforms.items()},
        sections={f"section_{name}": np.full(recording.revolutions, friction) for name in SECTION_NAMES},
        measures={
            v.name: 7 if "stator" not in v.dims else np.array([0 if "int" in v.dtype else friction])
            for v in case_measures()
        }
        | {"energy_residual": 1e-6},
        final=None,  # type: ignore[arg-type]
    )


class Physics:
    """Stands in for prepare and run_case; `poison` is what befalls cases of friction 0.3."""

    def __init__(self) -> None:
        self.frictions: list[float] = []
        self.prepared: list[float] = []
        self.poison: Callable[..., Record | None] = lambda **_: None
        self.on_case: Callable[[], None] = lambda: None

    def put_in(self, monkeypatch: pytest.MonkeyPatch) -> Self:
        """Have runs of this process take it."""
        monkeypatch.setattr(case_setup, "prepare", self.prepare)
        monkeypatch.setattr(worker, "run_case", self.run_case)
        monkeypatch.setattr(job, "_warm_up", lambda *_: None)
        return self

    def prepare(self, rig: Any, speed: float, **_: Any) -> SimpleNamespace:
        self.prepared.append(speed)
        return SimpleNamespace(model=None, spin=speed)

    def run_case(
        self,
        setup: SimpleNamespace,
        *,
        clearance: float,
        friction: float,
        recording: Recording,
        initial: None,
        check: Callable[[], None],
        say: Callable[[str], None],
        note: Callable[[float], None],
    ) -> Record:
        self.on_case()
        check()
        self.frictions.append(friction)
        poisoned = (
            self.poison(friction=friction, recording=recording, check=check) if friction == 0.3 else None
        )
        return poisoned or record(recording, friction)
