"""Tables of contact modes as the kernels read them: those of one mode, and the stack of many."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray  # noqa: TC002 - of a NamedTuple

from rubhpc.integrate.reduced_model.friction_mode import FrictionMode
from rubhpc.kernels import contact_modes as kernel
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL
from rubhpc.kernels.sampling import LANES

if TYPE_CHECKING:
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]

MOST_MODES = 1024  # sets of closed contacts of one speed and friction
FIRST_ROOM = 2  # for a contact-free case and one that enters a contact
NEXT_ROOM = 16  # for a case that goes on rubbing; then for all, since what is there has to be copied
MOST_BYTES = 2**30  # of their tables
GONE = -40.0  # exponent of what has died away
STEADY = 1e-13  # sum of two exponents over the greatest, below which it is zero but for rounding


class TableStack:
    """Tables of contact modes of one width, one after the other.

    Attributes
    ----------
    n_most : int
        ModeTables that there is room for: those of every pair closed by itself, and of as many more sets as
        `n_most` and `most_bytes` allow.
    """

    def __init__(self, n_least: int, n_most: int = MOST_MODES, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self.n_most = max(n_least, n_most)
        self._n_least, self._n_filled, self._n_written = n_least, 0, 0
        self._vacant: int | None = None  # place for the next one
        self._room: list[Any] = []
        self._view: Any = None

    def add(self, row: Any, count: int = 1) -> None:
        """Take in the tables of a mode, a named tuple of (1, ...) each, `count` times."""
        rows: list[Any] = list(row)
        if self._vacant is not None:
            for field, new in zip(self._room, rows, strict=True):
                field[self._vacant] = new[0]
            self._vacant = self._view = None
            return
        first, end = self._n_filled, self._n_filled + count
        if not self._room:
            n_bytes = sum(field.nbytes for field in rows)
            self.n_most = max(self._n_least, min(self.n_most, self._most_bytes // n_bytes))
            n_room = max(count, min(self._n_least, FIRST_ROOM))
            self._room = [np.empty((n_room, *field.shape[1:]), field.dtype) for field in rows]
            self._kind = type(row)
        elif end > len(self._room[0]):  # memory that is not written yet is not taken
            n_room = max(end, min(NEXT_ROOM, self.n_most) if end <= NEXT_ROOM else self.n_most)
            for i, field in enumerate(self._room):  # one after the other: all at once would take it twice
                self._room[i] = np.empty((n_room, *field.shape[1:]), field.dtype)
                self._room[i][:first] = field[:first]
        for field, new in zip(self._room, rows, strict=True):
            field[first:end] = new
        self._n_filled, self._n_written = end, max(self._n_written, end)
        self._view = None

    def clear(self) -> None:
        """Give all room back to contact modes to come."""
        self._n_filled, self._view, self._vacant = 0, None, None

    def vacate(self, place: int) -> None:
        """Give the place of a mode to the next one."""
        self._vacant = place

    @property
    def n_byte(self) -> int:
        """Memory that is held."""
        return self.n_byte_of_one * self._n_written

    def row(self, place: int) -> Any:
        """The tables of one mode, (1, ...) each."""
        return self._kind(*(field[place : place + 1] for field in self._room))

    @property
    def n_byte_of_one(self) -> int:
        """Memory that the tables of one mode take."""
        return sum(field[0].nbytes for field in self._room)

    def view(self) -> Any:
        """The tables of all contact modes."""
        if self._view is None:
            self._view = self._kind(*(field[: self._n_filled] for field in self._room))
        return self._view


def tabulate(
    mode: ContactMode,
    reduced: ReducedModel,
    slip: Floats,
    *,
    friction: Complexes | None = None,
    width: int,
    tick: float,
    sample_level: int,
    n_level: int,
    is_measured: bool = True,
    n_ahead: int = kernel.SAMPLES_AT_ONCE,
) -> kernel.ModeTables:
    """Tables of one mode, (1, ...) each, its coordinates padded to `width`.

    Parameters
    ----------
    slip : (q, n)
        Slip speed of each pair with the motion; none where the switch functions hold it.
    friction : (n, m), N, optional
        Friction forces on the motion with each coordinate; what they take is counted with the damping.
    tick : float, s
    sample_level, n_level : int
        As in `mode_library.ModeLibrary`.
    is_measured : bool
        Slip, outputs and energies are empty where not.
    n_ahead : int
        Samples whose outputs are read from one set of coordinates; with one, no step may pass a sample. With
        none, outputs are left to others.
    """
    n, m = reduced.stiffness.shape[0], width
    end, n_filled = mode.exponent.size, len(mode.enter)
    exponent, used = np.zeros(m, dtype=complex), np.zeros(m, dtype=bool)
    motion, enter = np.zeros((2, 2 * n, m), dtype=complex)
    switch = np.zeros((len(mode.switch), m), dtype=complex)
    take_off = np.zeros((len(mode.take_off), m), dtype=complex)
    exponent[:end], used[:end] = mode.exponent, True
    motion[:, :end], switch[:, :end] = mode.motion, mode.switch
    enter[:, :n_filled], take_off[:, :n_filled] = mode.enter.T, mode.take_off
    steps = tick * 2.0 ** np.arange(n_level)
    growth = np.exp(np.maximum(exponent.real, 0.0) * steps[-1])
    power = np.exp(exponent * steps[:, None]) * used
    rate = switch * exponent
    sliding = (slip if is_measured else slip[:0]) @ motion[n:]
    growing, bend = Growth(), np.zeros((0, m), dtype=complex)
    if isinstance(mode, FrictionMode):
        bend = switch * exponent**2
        growing = Growth(
            np.flatnonzero(mode.growth),
            mode.growth[mode.growth != 0.0],
            mode.n_eigenmode + 1 + len(mode.switch) // 2,
        )
        rate[:, growing.steady] += switch[:, growing.which] @ growing.speed
    rubbing = np.zeros((n, m), dtype=complex)
    if friction is not None:
        rubbing[:, :end] = friction
    output, loss = np.zeros((2 * m, 0)), np.zeros((0, 0))
    work, steady_power = np.zeros((2, 0), dtype=complex), np.zeros(2)
    if is_measured:
        output = _outputs(reduced, exponent, motion, tick * 2.0**sample_level, n_ahead)
        loss, work, steady_power = _energies(reduced, exponent, motion, rubbing, mode.n_eigenmode, growing)
    halves = np.stack([take_off.real, take_off.imag], axis=1)  # (2 + q or more, 2, m)
    row = kernel.ModeTables(
        mask=np.array(mode.mask),
        n_eigenmode=np.array(mode.n_eigenmode),
        switch_re=switch.real,
        switch_im=switch.imag,
        rate_re=rate.real,
        rate_im=rate.imag,
        bound=np.abs(switch) * np.abs(exponent) ** 2 * growth,
        bend_re=bend.real,
        bend_im=bend.imag,
        turn=np.abs(bend) * np.abs(exponent) * growth,
        pace=np.where(exponent.real * tick * 2**kernel.FORCED_LEVEL < GONE, kernel.DYING, np.abs(exponent)),
        power_re=power.real,
        power_im=power.imag,
        output=output,
        slip_re=sliding.real,
        slip_im=sliding.imag,
        slip_rate_re=(sliding * exponent).real,
        slip_rate_im=(sliding * exponent).imag,
        motion_re=motion.real,
        motion_im=motion.imag,
        enter_re=enter.real,
        enter_im=enter.imag,
        enter_cosine=halves[0],
        enter_sine=halves[1],
        enter_constant=halves[2:],
        loss=loss,
        work_re=work.real,
        work_im=work.imag,
        steady_power=steady_power,
    )
    fields: list[Any] = [np.ascontiguousarray(np.asarray(field)[None]) for field in row]
    return kernel.ModeTables(*fields)


class Growth(NamedTuple):
    """Coordinates that grow linearly, in a mode in which pairs stick."""

    which: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
    speed: NDArray[np.float64] = np.zeros(0)  # 1/s times their unit
    steady: int = -1  # the coordinate that is 1


def mode_of(row: kernel.ModeTables, kind: type[ContactMode], exponents: tuple[Floats, Floats]) -> ContactMode:
    """Return the contact mode that tables (1, ...) and exponents (`mode_library.ModeLibrary.exponents`) hold.

    `kind` is ContactMode or FrictionMode. It is the mode that was tabulated, bit for bit.
    """
    (parts, drift), m, q = exponents, int(row.n_eigenmode[0]), row.enter_constant.shape[1]
    rest: dict[str, Any] = {}
    if issubclass(kind, FrictionMode):  # the last row is of the coordinate that is 1
        end = n_filled = m + 2 * q
        rest = {"n_mode": m, "growth": drift[:end]}
    else:
        end, n_filled = m + 1 + q, m
    halves = np.concatenate([row.enter_cosine, row.enter_sine, row.enter_constant[0]])  # (2 + q, 2, m)
    return kind(
        mask=int(row.mask[0]),
        exponent=_joined(parts[0, :end], parts[1, :end]),
        motion=_joined(row.motion_re[0, :, :end], row.motion_im[0, :, :end]),
        enter=_joined(row.enter_re[0, :, :n_filled], row.enter_im[0, :, :n_filled]).T,
        take_off=_joined(halves[:, 0, :n_filled], halves[:, 1, :n_filled]),
        switch=_joined(row.switch_re[0, :, :end], row.switch_im[0, :, :end]),
        **rest,
    )


def _joined(real: Floats, imaginary: Floats) -> Complexes:
    """Complex numbers of these parts, the signs of zeros included."""
    joined = np.empty(real.shape, dtype=np.complex128)
    joined.real, joined.imag = real, imaginary
    return joined


def _outputs(
    reduced: ReducedModel, exponent: Complexes, motion: Complexes, interval: float, n_ahead: int
) -> Floats:
    """Output rows (`kernels.contact_modes`) at coming samples, `interval` (s) apart: (2 m, samples o).

    Zeros fill the rows up to whole vectors of the kernels.
    """
    if n_ahead == 0:
        return np.zeros((2 * exponent.size, 0))
    n = reduced.stiffness.shape[0]
    displacement, rate = reduced.output @ motion[:n], reduced.output @ motion[n:]
    rows = [displacement, rate, rate[2:] * exponent]
    for degree in reduced.degree:
        rows += [degree[[AXIAL, LATERAL]] @ motion[:n], degree[[LATERAL]] @ motion[n:]]
    for carrier in reduced.carrier:  # as axial and lateral
        rows += [carrier @ motion[:n], carrier[[1]] @ motion[n:]]
    positions, rates, accelerations = reduced.probe
    rows.append(positions @ motion[:n] + rates @ motion[n:] + (accelerations @ motion[n:]) * exponent)
    later = interval * np.arange(n_ahead)
    ahead = np.concatenate(rows) * np.exp(exponent * later[:, None])[:, None]  # (sample, o, m)
    table = ahead.reshape(-1, exponent.size).T
    outputs = np.zeros((2 * exponent.size, -(-table.shape[1] // LANES) * LANES))
    outputs[: exponent.size, : table.shape[1]] = table.real
    outputs[exponent.size :, : table.shape[1]] = -table.imag
    return outputs


def _energies(
    reduced: ReducedModel,
    exponent: Complexes,
    motion: Complexes,
    friction: Complexes,
    n_eigenmode: int,
    growing: Growth,
) -> tuple[Floats, Complexes, Floats]:
    """Primitives of the powers of damping and unbalance: (2 m, 2 m), (2, m) and steady (2,), W.

    With the damping counts `friction` (n, m), whose power on the motion is what the drive gives for it less
    what it turns into heat.
    Products of two coordinates go as exp((l_k + l_j) t) or exp((l_k + conj l_j) t). What has no primitive
    among them is steady: that of the unbalance response with itself. Undamped modes have none either,
    and nothing to lose.
    """
    n = reduced.stiffness.shape[0]
    skew = 0.5 * (reduced.stiffness - reduced.stiffness.T)
    shape, rate = motion[:n], motion[n:]
    resisting = reduced.damping @ rate + skew @ shape - friction
    phasor = reduced.force[0] - 1j * reduced.force[1]
    turning = np.full(exponent.shape, 1j * reduced.spin)
    forms = []
    for partner, other in ((resisting, exponent), (resisting.conj(), exponent.conj())):
        form = _primitive(rate.T @ partner, exponent[:, None] + other)
        if growing.which.size:
            _follow_growth(form, rate.T @ partner, exponent, n_eigenmode, growing)
        forms.append(form)
    with_itself, with_conjugate = forms
    loss = 0.5 * np.block(
        [
            [(with_itself + with_conjugate).real, (with_conjugate - with_itself).imag],
            [-(with_itself + with_conjugate).imag, (with_conjugate - with_itself).real],
        ]
    )
    work = 0.5 * np.stack(
        [
            _primitive(phasor @ rate, exponent + turning),
            _primitive(phasor.conj() @ rate, exponent - turning),
        ]
    )
    response = rate[:, n_eigenmode]
    steady = np.array([response @ resisting[:, n_eigenmode].conj(), response @ phasor.conj()])
    if growing.which.size:
        steady[0] += 2.0 * rate[:, growing.steady] @ resisting[:, growing.steady]
    return 0.5 * (loss + loss.T), work, 0.5 * steady.real


def _follow_growth(
    form: Complexes, power: Complexes, exponent: Complexes, n_eigenmode: int, growing: Growth
) -> None:
    """Correct primitives for coordinates that grow: `int z phi = z phi / l - phi' z / l^2`.

    Products of the coordinate that is 1 go as phi / phi' with a clearance, as phi^2 / (2 phi') with phi; that
    with itself is left to the steady power.
    """
    moving, one = slice(n_eigenmode + 1), growing.steady
    for phi, speed in zip(growing.which, growing.speed, strict=True):
        form[moving, one] -= speed * power[moving, phi] / exponent[moving] ** 2
        form[phi, phi] += 0.5 * power[one, phi] / speed
    first, speed = growing.which[0], growing.speed[0]
    clearances = slice(n_eigenmode + 1, one)
    form[first, clearances] += power[one, clearances] / speed


def _primitive(power: Complexes, exponent: Complexes) -> Complexes:
    """Power over its exponent, 1/s; zero where that is zero."""
    has_one = np.abs(exponent) > STEADY * np.abs(exponent).max()
    return np.divide(power, exponent, out=np.zeros_like(power), where=has_one)
