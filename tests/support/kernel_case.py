"""Kernel calls without a case around them: for tests that look at single steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.marches.workspace import workspace
from rubhpc.integrate.measuring.samples import empty_samples, new_accumulator
from rubhpc.integrate.packing import pack, pairs_of
from rubhpc.kernels.central_difference.march import Stepper, advance
from rubhpc.kernels.laws import MULTIPLIER

if TYPE_CHECKING:
    from rubhpc.fem.model import Model
    from rubhpc.integrate.packing import Packed
    from rubhpc.kernels.accumulators import Accumulator, Samples
    from rubhpc.kernels.contact_pairs import Pairs, Workspace


@dataclass
class KernelCase:
    """A rig packed at a speed, with its state; a step is a sample, `per_revolution` of them a turn."""

    model: Model
    packed: Packed
    pairs: Pairs
    work: Workspace
    spin: float
    step: float
    per_revolution: int
    state: np.ndarray  # (2, n_dof): displacement, and velocity half a step earlier
    samples: Samples
    accumulator: Accumulator

    @classmethod
    def of(
        cls,
        rig,
        spin,
        per_revolution,
        *,
        clearance=1.0,
        friction=0.3,
        is_updated=False,
        law=MULTIPLIER,
        n_sample=0,
    ):
        model = assemble(rig)
        step = 2 * math.pi / (abs(spin) * per_revolution)
        packed = pack(model, spin, step)
        pairs = pairs_of(
            model,
            row=packed.degree_row,
            block=packed.degree_block,
            compliance=packed.compliance,
            clearance=clearance,
            friction=friction,
            spin=spin,
            is_updated=is_updated,
            law=law,
        )
        return cls(
            model=model,
            per_revolution=per_revolution,
            packed=packed,
            pairs=pairs,
            work=workspace(pairs, step),
            spin=spin,
            step=step,
            state=np.zeros((2, packed.mass.shape[0])),
            samples=empty_samples(len(model.stators), n_sample),
            accumulator=new_accumulator(len(model.stators)),
        )

    def advance(self, first, last, *, is_recorded=False, limit=1.0):
        """Outcome of the kernel over samples `first` to `last`."""
        packed = self.packed
        stepper = Stepper(
            packed.linear, self.spin, self.step, self.per_revolution, limit, packed.output_row, packed.probe
        )
        return advance(
            stepper,
            self.pairs,
            1,
            first,
            last,
            is_recorded,
            self.state,
            self.work,
            np.zeros((3, self.state.shape[1])),
            self.samples,
            self.accumulator,
            np.zeros(1, dtype=np.int64),
        )
