"""What of a contact mode goes with the speed: polynomials over a range of speeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels._jit import jit, linked
from rubhpc.kernels._struct import Struct

if TYPE_CHECKING:
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]


class Course(Struct):
    """Entries of an array that go with the speed, k of them."""

    at: Ints  # (k,), in the array, flat
    value: Floats  # (p, k), factors of the powers 0, 1, ... of the place in the range, from -1 to 1


class Courses(Struct):
    """What of a mode goes with the speed; none of it where nothing does."""

    kept: Floats  # (s,), the memory of what `filling.ModeCourse` has of it
    kept_shape: Course
    kept_entry: Course
    motion_re: Course  # of the tables, as those that follow
    motion_im: Course
    switch_re: Course
    switch_im: Course
    rate_re: Course  # but for those of eigenmodes and the response
    rate_im: Course
    slip_re: Course
    slip_im: Course
    enter_re: Course
    enter_im: Course
    enter_constant: Course
    loss: Course


@jit
def take_course(course: Course, place: float, values: Floats) -> None:
    """Bring an array (s,) to a place in the range."""
    value, at = course.value, course.at
    last = value.shape[0] - 1
    if last == 2:  # written out, these take a third of the time
        for j in range(at.size):
            values[at[j]] = (value[2, j] * place + value[1, j]) * place + value[0, j]
        return
    if last == 6:
        for j in range(at.size):
            upper = ((value[6, j] * place + value[5, j]) * place + value[4, j]) * place + value[3, j]
            lower = ((upper * place + value[2, j]) * place + value[1, j]) * place + value[0, j]
            values[at[j]] = lower
        return
    for j in range(at.size):
        total = value[last, j]
        for p in range(last - 1, -1, -1):
            total = total * place + value[p, j]
        values[at[j]] = total


@linked
def follow(tables: ModeTables, mode: int, courses: Courses, place: float) -> None:
    """Bring a mode and its tables to a place in the range, but for what follows from these."""
    take_course(courses.kept_shape, place, courses.kept)
    take_course(courses.kept_entry, place, courses.kept)
    take_course(courses.motion_re, place, tables.motion_re[mode].reshape(-1))
    take_course(courses.motion_im, place, tables.motion_im[mode].reshape(-1))
    take_course(courses.switch_re, place, tables.switch_re[mode].reshape(-1))
    take_course(courses.switch_im, place, tables.switch_im[mode].reshape(-1))
    take_course(courses.rate_re, place, tables.rate_re[mode].reshape(-1))
    take_course(courses.rate_im, place, tables.rate_im[mode].reshape(-1))
    take_course(courses.slip_re, place, tables.slip_re[mode].reshape(-1))
    take_course(courses.slip_im, place, tables.slip_im[mode].reshape(-1))
    take_course(courses.enter_re, place, tables.enter_re[mode].reshape(-1))
    take_course(courses.enter_im, place, tables.enter_im[mode].reshape(-1))
    take_course(courses.enter_constant, place, tables.enter_constant[mode].reshape(-1))
    take_course(courses.loss, place, tables.loss[mode].reshape(-1))


@linked
def follow_rates(tables: ModeTables, mode: int, exponent: Complexes, n_eigenmode: int) -> None:
    """Rates of what eigenmodes make of switch functions and slip, as their exponents are."""
    for i in range(tables.switch_re.shape[1]):
        for k in range(n_eigenmode):
            rate = complex(tables.switch_re[mode, i, k], tables.switch_im[mode, i, k]) * exponent[k]
            tables.rate_re[mode, i, k], tables.rate_im[mode, i, k] = rate.real, rate.imag
    for i in range(tables.slip_re.shape[1]):
        for k in range(n_eigenmode):
            rate = complex(tables.slip_re[mode, i, k], tables.slip_im[mode, i, k]) * exponent[k]
            tables.slip_rate_re[mode, i, k], tables.slip_rate_im[mode, i, k] = rate.real, rate.imag
