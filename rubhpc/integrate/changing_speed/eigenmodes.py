"""Coordinates of the eigenmodes of a contact mode for a motion, at any speed of the shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.integrate.changing_speed.mode_courses import taken
from rubhpc.kernels.courses import take_course

if TYPE_CHECKING:
    from rubhpc.kernels.contact_modes import ModeTables
    from rubhpc.kernels.filling import ModeCourse

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Eigenmodes(NamedTuple):
    """The m eigenmodes of a set of closed pairs, which do not depend on the speed."""

    exponent: Complexes  # (m,), 1/s
    is_pair: NDArray[np.bool_]  # (m,)
    motion: Complexes  # (2 n, m)
    enter: Complexes  # (m, 2 n)
    constant: Complexes  # (c, m), for a unit of each coordinate that does not move
    drive: Complexes  # (m,), by the unbalance at unit speed
    mirrored_drive: Complexes  # (m,)

    @classmethod
    def of(cls, row: ModeTables, course: ModeCourse, within: float) -> Eigenmodes:
        """Eigenmodes of tables that follow the speed, at a place in the range."""
        courses, m = course.courses, course.is_pair.size
        for part in (courses.kept_shape, courses.kept_entry):
            take_course(part, within, courses.kept)
        constant = taken(courses.enter_constant, row.enter_constant[0], within)[:, :, :m]
        motion, enter = (
            taken(re, re_of[0], within)[:, :m] + 1j * taken(im, im_of[0], within)[:, :m]
            for re, im, re_of, im_of in (
                (courses.motion_re, courses.motion_im, row.motion_re, row.motion_im),
                (courses.enter_re, courses.enter_im, row.enter_re, row.enter_im),
            )
        )
        return cls(
            exponent=course.exponent[:m].copy(),
            is_pair=course.is_pair,
            motion=motion,
            enter=enter.T,
            constant=constant[:, 0] + 1j * constant[:, 1],
            drive=course.drive.copy(),
            mirrored_drive=course.mirrored_drive.copy(),
        )

    def entered(
        self, motion: Floats, constants: Floats, turning: complex, factor: complex, time: float
    ) -> Complexes:
        """Coordinates (m,) of a motion (2 n,) at a time, s.

        `turning` (1/s) is the exponent of the unbalance force, `factor` (1/s^2) that of the unbalance at unit
        speed at time 0.
        """
        direct, other = self.forced(turning, factor)
        turned = np.exp(turning * time)
        response = direct * turned + other * turned.conj()
        coordinates: Complexes = self.enter @ motion - constants @ self.constant - response
        return coordinates

    def forced(self, turning: complex, factor: complex) -> tuple[Complexes, Complexes]:
        """Response to the unbalance at time 0: parts with `exp(turning t)` and with its conjugate."""
        direct = self.drive * factor / (turning - self.exponent)
        mirrored = self.mirrored_drive * factor / (turning - self.exponent.conj())
        other: Complexes = np.where(self.is_pair, mirrored, direct).conj()
        return 0.5 * direct, 0.5 * other

    def response(self, turning: complex, factor: complex) -> Complexes:
        """The same as a motion (2 n,), which turns as `exp(turning t)`: its real part."""
        direct, other = self.forced(turning, factor)
        twice = np.where(self.is_pair, 1.0, 2.0) * direct
        back = np.where(self.is_pair, other.conj(), 0.0)
        motion: Complexes = self.motion @ twice + self.motion.conj() @ back
        return motion
