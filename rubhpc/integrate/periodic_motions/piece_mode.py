"""A contact mode as the pieces of a motion need it: to be followed, and to carry small changes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.kernels.closed_form.flow import PieceTables
from rubhpc.kernels.closed_form.revolutions import PieceModes

if TYPE_CHECKING:
    from rubhpc.integrate.marches.event_driven import EventDrivenMarch
    from rubhpc.kernels.contact_modes import ModeTables

Floats = NDArray[np.float64]


class Mode(NamedTuple):
    """A contact mode: q pairs, m coordinates.

    Attributes
    ----------
    place : int
        In the tables of the march.
    is_closed : (q,)
        Whether each pair is closed.
    n_moving : int
        Coordinates up to the last that moves with the motion.
    tables : PieceTables
        What a piece is followed with.
    unit_length : (q, 2, m)
        Coordinates besides for a unit clearance of each pair.
    """

    place: int
    is_closed: NDArray[np.bool_]
    n_moving: int
    tables: PieceTables
    unit_length: Floats


def mode_of(march: EventDrivenMarch, states: int) -> Mode:
    """Return the mode of a march with these pairs closed, which its tables hold."""
    if states not in march.derived:
        march.derived[states] = _read_mode(march, states)
    mode: Mode = march.derived[states]
    offset = mode.tables.offset.copy()
    lengths = mode.unit_length.reshape(len(mode.unit_length), -1)
    offset[:, 2] = (march.bodies.clearance @ lengths).reshape(2, -1)
    followed = mode.tables._replace(
        offset=offset,
        translations=march.bodies.translations,
        displacement_limit=march.bodies.displacement_limit,
    )
    return mode._replace(place=_place_of(march, states), tables=followed)


def _place_of(march: EventDrivenMarch, states: int) -> int:
    """Place of a mode in the tables of a march; those of another case of its library may differ."""
    return int(np.flatnonzero(march.tables.mask == states)[0])


def unknown_modes(tables: ModeTables) -> PieceModes:
    """Return the contact modes of tables for whole revolutions, none of them known yet (`know`)."""
    p, _, m = tables.switch_re.shape
    return PieceModes(
        mask=tables.mask,
        is_known=np.zeros(p, dtype=np.bool_),
        n_moving=np.empty(p, dtype=np.int64),
        switch_re=tables.switch_re,
        switch_im=tables.switch_im,
        rate_re=tables.rate_re,
        rate_im=tables.rate_im,
        bound=tables.bound,
        power_re=tables.power_re,
        power_im=tables.power_im,
        exponent=np.empty((p, 2, m)),
        enter_re=tables.enter_re,
        enter_im=tables.enter_im,
        offset=np.empty((p, 2, 3, m)),
        shape_re=tables.motion_re,
        shape_im=tables.motion_im,
    )


def know(modes: PieceModes, mode: Mode) -> None:
    """Fill in the row of a mode."""
    place, tables = mode.place, mode.tables
    modes.n_moving[place] = mode.n_moving
    modes.exponent[place], modes.offset[place] = tables.exponent, tables.offset
    modes.is_known[place] = True


def _read_mode(march: EventDrivenMarch, states: int) -> Mode:
    """Take a mode from the tables of a march, for no clearance."""
    tables = march.tables
    place = _place_of(march, states)
    first = tables.n_eigenmode[place]
    offset = np.zeros((2, 3, tables.switch_re.shape[2]))
    offset[:, 0], offset[:, 1] = -tables.enter_cosine[place], -tables.enter_sine[place]
    offset[:, :, first] = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    unit_length = -tables.enter_constant[place]
    unit_length[:, :, first] = 0.0
    for i, length in enumerate(unit_length):
        length[0, first + 1 + i] = 1.0
    followed = PieceTables(
        closed=states,
        switch_re=tables.switch_re[place],
        switch_im=tables.switch_im[place],
        rate_re=tables.rate_re[place],
        rate_im=tables.rate_im[place],
        bound=tables.bound[place],
        power_re=tables.power_re[place],
        power_im=tables.power_im[place],
        exponent=march.exponents(states),
        enter_re=tables.enter_re[place],
        enter_im=tables.enter_im[place],
        offset=offset,
        shape_re=tables.motion_re[place],
        shape_im=tables.motion_im[place],
        translations=march.bodies.translations,
        displacement_limit=march.bodies.displacement_limit,
    )
    is_moving = (followed.enter_re != 0.0).any(axis=0) | (followed.enter_im != 0.0).any(axis=0)
    return Mode(
        place=place,
        is_closed=march.closed(states),
        n_moving=int(np.flatnonzero(is_moving).max(initial=-1)) + 1,
        tables=followed,
        unit_length=unit_length,
    )
