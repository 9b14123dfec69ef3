"""Bodies with curved gaps: motions of a pair along the axis, along the rim and by bending."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rubhpc.fem.statics import sag_at_stators
from rubhpc.kernels._jit import plain
from rubhpc.kernels.contact_pairs import AXIAL, LATERAL, TORSION, V, W, rim_sense
from rubhpc.kernels.curved_contact import ACROSS, ALONG, BENDING, CurvedPairs

if TYPE_CHECKING:
    from rubhpc.fem.model import Model, StatorModel
    from rubhpc.integrate.reduced_model.reduction import ReducedModel

Floats = NDArray[np.float64]

UNBENT = 1e-8  # bending displacement over the largest of a stator; smaller ones count as zero
SKEWED = 1e-14  # skew part of the stiffness over its largest entry; less is rounding


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
