"""The contact modes of a reduced model with curved gaps: bodies, further tables, and the library of modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rubhpc.fem.statics import sag_at_stators
from rubhpc.integrate.reduced_model.mode_library import ModeLibrary
from rubhpc.integrate.reduced_model.table_stack import TableStack
from rubhpc.kernels._jit import plain
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, TORSION, V, W, rim_sense
from rubhpc.kernels.curved_contact import ACROSS, ALONG, BENDING, N_NODE, CurvedPairs, CurvedTables
from rubhpc.kernels.curved_tuning import tune_curved

if TYPE_CHECKING:
    from rubhpc.fem.model import Model, StatorModel
    from rubhpc.integrate.reduced_model.contact_mode import ContactMode
    from rubhpc.integrate.reduced_model.reduction import ReducedModel
    from rubhpc.kernels.contact_modes import ModeTables


Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

UNBENT = 1e-8  # bending displacement over the largest of a stator; smaller ones count as zero
SKEWED = 1e-14  # skew part of the stiffness over its largest entry; less is rounding

LONGEST_STEP = 1e-3  # s, of closed contacts
UNDAMPED = 1e-14  # eigenvalue of the damping over the largest; smaller ones count as zero


def curved_pairs(
    reduced: ReducedModel, model: Model, friction: float, clearance: Floats, *, is_round: bool
) -> CurvedPairs:
    """Pairs of a case whose gaps are curved; clearance (q,) at rest in m."""
    row = motion_rows(reduced, model)
    flat = row.reshape(-1, row.shape[2])
    sense = plain(rim_sense)(reduced.spin)
    return CurvedPairs(
        row=row,
        gram=(flat @ flat.T).reshape(*row.shape[:2], *row.shape[:2]),
        output=_outputs(reduced),
        skew=_skew(reduced),
        radius=np.array([stator.radius for stator in model.stators]),
        clearance=clearance,
        aside=sag_at_stators(model)[1],
        friction=np.full(clearance.size, sense * friction),
        stiffness=np.array(
            [_stiffness(stator, row[i, ALONG], reduced) for i, stator in enumerate(model.stators)]
        ),
        leverage=_leverage(row, reduced),
        is_round=is_round,
        sense=sense,
    )


def followed_pairs(pairs: CurvedPairs, reduced: ReducedModel, model: Model, clearance: Floats) -> CurvedPairs:
    """The same pairs about another sag, with its clearances (q,) in m; scales of errors stay."""
    output = _outputs(reduced) if reduced.probe.size else pairs.output
    return pairs._replace(
        output=output, skew=_skew(reduced), clearance=clearance, aside=sag_at_stators(model)[1]
    )


def motion_rows(reduced: ReducedModel, model: Model) -> Floats:
    """Motions of each pair with the reduced coordinates, (q, 3 + b, n), as `CurvedPairs.row` has them."""
    angle = np.array([stator.angle for stator in model.stators])[:, None]
    ey, ez = np.cos(angle), np.sin(angle)
    v, w, torsion, axial, lateral = (reduced.degree[:, a] for a in (V, W, TORSION, AXIAL, LATERAL))
    bending = [_bending(stator, reduced, model, i) for i, stator in enumerate(model.stators)]
    n_bending = max(len(rows) for rows in bending)
    rows = np.zeros((len(bending), BENDING + n_bending + 1, v.shape[1]))
    rows[:, ALONG], rows[:, ACROSS] = axial - ey * v - ez * w, lateral + ez * v - ey * w
    for i, those in enumerate(bending):
        rows[i, BENDING : BENDING + len(those)] = those
    rows[:, -1] = torsion
    return rows


def _skew(reduced: ReducedModel) -> Floats:
    """Skew part of the stiffness (n, n), or no rows where it is rounding."""
    skew: Floats = 0.5 * (reduced.stiffness - reduced.stiffness.T)
    return skew if np.abs(skew).max() > SKEWED * np.abs(reduced.stiffness).max() else skew[:0]


def _bending(stator: StatorModel, reduced: ReducedModel, model: Model, i: int) -> Floats:
    """Displacements (b, n) whose squares add up to twice the foreshortening of a stator."""
    if stator.squared_slope is None:
        return np.zeros((0, reduced.stiffness.shape[0]))
    first = model.stator_start[i]
    basis = reduced.basis[first : first + stator.body.n_dof]
    square, shape = np.linalg.eigh(stator.squared_slope)
    _, size, turn = np.linalg.svd((np.sqrt(np.maximum(square, 0.0)) * shape).T @ basis, full_matrices=False)
    keep = size > UNBENT * size.max()
    rows: Floats = size[keep, None] * turn[keep]
    return rows


def _stiffness(stator: StatorModel, along: Floats, reduced: ReducedModel) -> float:
    """Static stiffness of a stator's tip along its axis, N/m; on a rigid wall that of the rotor."""
    if stator.axial_compliance > 0.0:
        return 1.0 / stator.axial_compliance
    return float(1.0 / (along @ np.linalg.solve(reduced.stiffness, along)))


def _leverage(row: Floats, reduced: ReducedModel) -> Floats:
    """Bending displacements where a static lateral force moves the tip by 1 m, (q, b)."""
    shape = np.linalg.solve(reduced.stiffness, row[:, ACROSS].T)  # (n, q)
    leverage = np.zeros((len(row), row.shape[1] - BENDING - 1))
    for i, those in enumerate(row):
        moved = those @ shape[:, i]
        leverage[i] = np.abs(moved[BENDING:-1]) / moved[ACROSS] if moved[ACROSS] > 0.0 else 0.0
    return leverage


def _outputs(reduced: ReducedModel) -> Floats:
    """Rows of outputs, as `kernels.contact_modes` numbers them, of displacements and their derivatives."""
    still = np.zeros_like(reduced.output[:1])
    rows = [[one, 0 * one, 0 * one] for one in reduced.output]
    rows += [[0 * one, one, 0 * one] for one in reduced.output]
    rows.append([still[0], still[0], reduced.output[2]])
    places = [degree[[AXIAL, LATERAL]] for degree in reduced.degree] + list(reduced.carrier)
    for axial, lateral in places:
        rows += [[axial, 0 * axial, 0 * axial], [lateral, 0 * lateral, 0 * lateral]]
        rows.append([0 * lateral, lateral, 0 * lateral])
    rows += [list(one) for one in np.swapaxes(reduced.probe, 0, 1)]
    return np.ascontiguousarray(np.swapaxes(np.array(rows), 0, 1))


def tabulate_curved(
    mode: ContactMode,
    reduced: ReducedModel,
    row: Floats,
    directions: tuple[Floats, Floats],
    *,
    width: int,
    tick: float,
    n_level: int,
) -> CurvedTables:
    """Tables of one mode, (1, ...) each, its coordinates padded to `width`.

    Parameters
    ----------
    row : (q, 3 + b, n)
        `motion_rows`.
    directions : (q, n), (q, n)
        Gap Jacobian Q and contact-force directions P with the fixed normal. `E = P (Q P)^-1` changes the gaps
        of the closed pairs; its projection is zero, as that of contact forces.
    n_level : int
        As in `mode_library.ModeLibrary`.
    """
    n, end = reduced.stiffness.shape[0], mode.exponent.size
    exponent, enter = np.zeros(width, dtype=complex), np.zeros((width, 2 * n), dtype=complex)
    exponent[:end], enter[: len(mode.enter)] = mode.exponent, mode.enter
    motion = np.zeros((2 * n, width)), np.zeros((2 * n, width))
    motion[0][:, :end], motion[1][:, :end] = mode.motion.real, mode.motion.imag
    still, n_step = still_parts(mode, reduced, row, directions), n_tabulated(tick, n_level)
    tables = empty_tables(still, width, n_step)
    push(tables, 0, still, reduced, enter)
    tune(tables, 0, still, reduced, exponent, motion, tick * 2.0 ** (n_step - 1))
    return tables


def empty_tables(still: StillParts, width: int, n_step: int) -> CurvedTables:
    """Tables of a mode, (1, ...) each, for steps of `n_step` lengths, without what belongs to matrices."""
    q, d = len(still.row), still.row.shape[1] - 1
    n_loss, n_at = still.size.size, N_NODE - 1
    n_read, n_load = 3 * d + 1, d + 2
    n_seen = n_read if q == 1 else 0
    drain_moved = np.zeros((1, n_loss + 2, q))
    drain_moved[0, :n_loss] = (still.shift @ still.dampers).T
    return CurvedTables(
        used=np.full(1, width),
        read_re=np.zeros((1, q, n_read, width)),
        read_im=np.zeros((1, q, n_read, width)),
        bound=np.zeros((1, q, d, width)),
        shift=still.shift[np.newaxis],
        moved=still.moved[np.newaxis],
        accel=np.zeros((1, q, d, q)),
        accel_rate=np.zeros((1, q, d, q)),
        load_re=np.zeros((1, q, n_load, width)),
        load_im=np.zeros((1, q, n_load, width)),
        exponent_re=np.zeros((1, width)),
        exponent_im=np.zeros((1, width)),
        is_filled=np.zeros((1, n_step), dtype=np.bool_),
        node_re=np.zeros((1, n_step, n_at, width)),
        node_im=np.zeros((1, n_step, n_at, width)),
        weight_re=np.zeros((1, n_step, n_at, N_NODE, width)),
        weight_im=np.zeros((1, n_step, n_at, N_NODE, width)),
        seen_re=np.zeros((1, n_load, n_seen, width)),
        seen_im=np.zeros((1, n_load, n_seen, width)),
        lone=np.zeros((1, n_step, 2, width, n_at * n_seen)),
        reach=np.zeros((1, n_step, N_NODE * n_load, n_at * n_seen)),
        reached=np.zeros((1, n_step, n_at * n_seen, n_at * n_load)),
        inverse_re=np.zeros((1, width)),
        inverse_im=np.zeros((1, width)),
        drain=np.zeros((1, 2, width, n_loss + 2)),
        sign=np.sign(still.size)[np.newaxis],
        drain_moved=drain_moved,
    )


def n_tabulated(tick: float, n_level: int) -> int:
    """Number of tabulated steps, of 1, 2, 4... ticks (s), among those of a library."""
    return min(n_level, max(1, int(np.log2(LONGEST_STEP / tick))))


class StillParts(NamedTuple):
    """Parts of a mode's tables that do not depend on the spin speed."""

    row: Floats  # (q, 3 + b, n), `motion_rows`
    first: int  # coordinate of the response to the unbalance
    closed: list[int]
    shift: Floats  # (q, n), as in `CurvedTables`
    moved: Floats
    passed: Floats  # (n, n), what the closed pairs leave of a force
    size: Floats  # (r,), eigenvalues of the damping
    dampers: Floats  # (n, r), their shapes, times the roots of their sizes


def still_parts(
    mode: ContactMode, reduced: ReducedModel, row: Floats, directions: tuple[Floats, Floats]
) -> StillParts:
    """Parts of the tables of a mode that do not depend on the speed; arguments as of `tabulate_curved`.

    Energies, for which the damping is taken apart, are not requested where it depends on the speed.
    """
    n, q = reduced.stiffness.shape[0], len(row)
    closed = [i for i in range(q) if mode.mask >> i & 1]
    rate, along = directions[0][closed], directions[1][closed].T
    shift = np.zeros((q, n))
    if closed:
        shift[closed] = np.linalg.solve((rate @ along).T, along.T)
    size, shape = _losses(reduced)
    return StillParts(
        row=row,
        first=mode.n_eigenmode,
        closed=closed,
        shift=shift,
        moved=row @ shift.T,
        passed=np.eye(n) - shift[closed].T @ rate,
        size=size,
        dampers=np.sqrt(np.abs(size)) * shape,
    )


def push(
    tables: CurvedTables, place: int, still: StillParts, reduced: ReducedModel, enter: Complexes
) -> None:
    """Fill what belongs to the matrices, but not to the speed; `enter` (m, 2 n) are the coordinates."""
    row, n = still.row, reduced.stiffness.shape[0]
    flat = row[:, :-1]
    elastic, damped = reduced.stiffness @ still.shift.T, reduced.damping @ still.shift.T
    tables.accel[place], tables.accel_rate[place] = flat @ elastic, flat @ damped
    for i in still.closed:
        columns = still.passed @ np.column_stack([elastic[:, i], damped[:, i], *flat[i]])
        load = (enter[: still.first, n:] @ columns).T
        tables.load_re[place, i, :, : still.first] = load.real
        tables.load_im[place, i, :, : still.first] = load.imag


def tune(
    tables: CurvedTables,
    place: int,
    still: StillParts,
    reduced: ReducedModel,
    exponent: Complexes,
    motion: tuple[Floats, Floats],
    longest: float,
) -> None:
    """Fill what belongs to the speed and the unbalance force of `reduced`.

    Parameters
    ----------
    exponent, motion : (m,), two of (2 n, m)
        Of the coordinates, including that of the response; the motion by its real and its imaginary part.
    longest : float
        The longest step, s.
    """
    tune_curved(
        tables,
        place,
        still.first,
        not still.closed,
        longest,
        exponent,
        *motion,
        still.row,
        still.dampers,
        reduced.stiffness,
        reduced.damping,
        reduced.force,
        np.empty((2, len(reduced.stiffness))),
    )


def _losses(reduced: ReducedModel) -> tuple[Floats, Floats]:
    """Nonzero eigenvalues (r,) of the symmetric damping, and their shapes (n, r)."""
    size, shape = np.linalg.eigh(0.5 * (reduced.damping + reduced.damping.T))
    keep = np.abs(size) > UNDAMPED * np.abs(size).max()
    return size[keep], shape[:, keep]


class CurvedLibrary(ModeLibrary):
    """Contact modes of one speed and friction, with further tables for curved gaps."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._row = motion_rows(args[0], args[1])
        self._curved: TableStack | None = None
        super().__init__(*args, **kwargs)

    @property
    def n_most(self) -> int:
        """Contact modes that there is room for."""
        return super().n_most if self._curved is None else min(super().n_most, self._curved.n_most)

    _is_parted = False  # tables of curved gaps do not depend on recording

    @property
    def n_byte(self) -> int:
        """Memory that its tables hold."""
        return super().n_byte + (0 if self._curved is None else self._curved.n_byte)

    def forget(self) -> None:
        """Make room: keep no mode but that with every pair open."""
        if self._curved is not None:
            self._curved.clear()
        super().forget()

    def make_room(self) -> None:
        """Forget all modes: curved gaps have further tables of each mode."""
        self.forget()

    def curved_tables(self) -> CurvedTables:
        """Further tables of all contact modes for curved gaps."""
        assert self._curved is not None
        tables: CurvedTables = self._curved.view()
        return tables

    def _friction_of(self, mode: ContactMode) -> None:
        """None: the direction of friction is that of the current normal."""

    def _tabulate(self, mode: ContactMode, row: ModeTables | None = None) -> None:
        super()._tabulate(mode, row)
        if self._curved is None:
            self._curved = TableStack(1 + len(self.gap_jacobian), self._most_modes)
        self._curved.add(
            tabulate_curved(
                mode,
                self.reduced,
                self._row,
                (self.gap_jacobian, self.force_direction),
                width=self.width,
                tick=self._tick,
                n_level=self._n_level,
            )
        )
