"""Compiles or loads the kernels of a study's cases, on the beginnings of a few of them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.case import compile_kernels, kernel_sets
from rubhpc.integrate.compilation import expect_sets
from rubhpc.running.case_setup import KeptSetups, case_for_kernels, set_up_for_kernels
from rubhpc.running.worker import record_of
from rubhpc.study.speed_law import SpeedLaw

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rubhpc.study.cases import Case, CaseGrid

WARM = 4  # checks, and revolutions, of a case of a changing speed or of branches


class _Enough(BaseException):  # no error: it ends a case, whatever it is doing
    pass


def warm_up(grid: CaseGrid, index: Sequence[int], check: Callable[[], None]) -> None:
    """Do so for each law of contact of the study, elsewhere as at an index; see `load_kernels`."""
    cases = grid.with_each_law(index)
    setups = [set_up_for_kernels(grid.study, case) for case in cases]
    expect_sets(set().union(*(kernel_sets(setup) for setup in setups)))
    for case in cases:
        load_kernels(grid, case, check)


def load_kernels(grid: CaseGrid, case: Case, check: Callable[[], None]) -> None:
    """Compile or load the kernels of a case's law of contact, on its beginning."""
    study = grid.study
    if case.speed_law is None and study.branch is None:
        compile_kernels(
            set_up_for_kernels(study, case),
            clearance=case.clearance,
            friction=case.friction,
            recording=study.recording,
            check=check,
        )
        return
    n_check = iter(range(WARM))

    def few() -> None:
        check()
        if next(n_check, None) is None:
            raise _Enough

    short = case_for_kernels(study, case)
    if isinstance(law := short.speed_law, SpeedLaw):  # a whole one takes seconds to be cut into pieces
        short = replace(short, speed_law=part_of(law, 0, min(law.n_revolution, WARM)))
    with suppress(_Enough):
        record_of(grid, short, KeptSetups(study), None, few)


def part_of(law: SpeedLaw, first: int, last: int) -> SpeedLaw:
    """A law from one revolution to another."""
    (begin, end), speeds, _ = law.at_angle(2.0 * np.pi * np.array([first, last * (1.0 + 1e-9)]))
    inner = [(t, v) for t, v in zip(law.time, law.speed, strict=True) if begin < t < end]
    times, values = zip(*[(begin, speeds[0]), *inner, (end, speeds[1])], strict=True)
    return SpeedLaw(time=tuple(map(float, times)), speed=tuple(map(float, values)))
