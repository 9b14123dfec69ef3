"""Branches of periodic motions for users: points with stability, events and states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rubhpc.integrate.branches.events import Event
from rubhpc.integrate.periodic_motion import record_of_period
from rubhpc.integrate.periodic_motions.revolution import least_of
from rubhpc.schema import BRANCH_EVENT

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from rubhpc.integrate.branches.arclength import Track
    from rubhpc.integrate.branches.branching import Branching
    from rubhpc.integrate.branches.point import Point
    from rubhpc.integrate.periodic_motions.family import Family
    from rubhpc.integrate.record import Record, State
    from rubhpc.study.tables import Recording

    Floats = NDArray[np.float64]
    Complexes = NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True, eq=False)
class BranchPoint:
    """A periodic motion on a branch.

    Attributes
    ----------
    value : float
        Of the parameter, SI.
    event : str
        "none", "fold", "period_doubling", "neimark_sacker", "grazing", "end" or "branch_point".
    multipliers : (n_state,)
        Floquet multipliers over a period, complex, largest first.
    state : State
        Motion with the shaft at its angle 0: `initial=` of `periodic` or `simulate`.
    least_gap, least_force : (n_stator,), m, N
        Distance to grazing, as of a `PeriodicMotion`.
    touches : int
        In a period.
    """

    value: float
    event: str
    multipliers: Complexes
    state: State
    least_gap: Floats
    least_force: Floats
    touches: int

    @property
    def is_stable(self) -> bool:
        """Whether all multipliers lie within the unit circle."""
        return bool(abs(self.multipliers[0]) < 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Branch:
    """A curve of periodic motions over one parameter, stable and unstable.

    Attributes
    ----------
    along : str
        The parameter.
    period : int
        Revolutions.
    points : tuple of BranchPoint
        In order along the branch; the parameter turns at folds.
    end : str
        Reason of the end, on each side.
    """

    along: str
    period: int
    points: tuple[BranchPoint, ...]
    end: str
    _family: Family
    _recording: Recording

    @property
    def values(self) -> Floats:
        """The parameter at each point, (n_point,), SI."""
        return np.array([point.value for point in self.points])

    @property
    def is_stable(self) -> NDArray[np.bool_]:
        """Whether each point is stable, (n_point,)."""
        return np.array([point.is_stable for point in self.points])

    def events(self) -> list[tuple[str, float]]:
        """Events on the branch in order, without its ends: name and parameter of each."""
        quiet = (Event.NONE.name.lower(), Event.END.name.lower())
        return [(point.event, float(point.value)) for point in self.points if point.event not in quiet]

    def record(self, i_point: int) -> Record:
        """Signals, spectra, sections and measures over a period of the motion at a point."""
        point = self.points[i_point]
        setup, clearance, friction = self._family.settings(point.value)
        return record_of_period(
            setup,
            clearance,
            friction,
            point.state,
            self.period,
            complex(point.multipliers[0]),
            1,
            self._recording,
        )

    def to_dataset(self) -> xr.Dataset:
        """Measures, stability, events and multipliers along the branch, one value a point."""
        import xarray as xr

        records = [self.record(i).to_dataset() for i in range(len(self.points))]
        kept = [name for name, array in records[0].items() if set(array.dims) <= {"stator"}]
        dataset = xr.concat([record[kept] for record in records], "point", combine_attrs="override")
        n_most = max(point.multipliers.size for point in self.points)
        multipliers = np.full((len(self.points), n_most), np.nan, dtype=np.complex128)
        for i, point in enumerate(self.points):
            multipliers[i, : point.multipliers.size] = point.multipliers
        names = [event.name.lower() for event in Event]
        assert tuple(names) == BRANCH_EVENT
        return dataset.assign(
            stability=("point", self.is_stable.astype(np.int8)),
            event=("point", np.array([names.index(point.event) for point in self.points], dtype=np.int8)),
            multiplier_real=(("point", "multiplier"), multipliers.real),
            multiplier_imag=(("point", "multiplier"), multipliers.imag),
        ).assign_coords({self.along.replace(".", "_"): ("point", self.values)})

    def __repr__(self) -> str:
        """One line: period, range, points and events."""
        found = self.values
        events = ", ".join(f"{name} {value:.6g}" for name, value in self.events()) or "no events"
        span = f"{self.along} {found.min():.4g} to {found.max():.4g}"
        return f"<Branch: period {self.period}, {span}, {len(self.points)} points; {events}>"


def branch_of(branching: Branching, track: Track, recording: Recording) -> Branch:
    """Convert a track to a branch for users."""
    return Branch(
        along=branching.family.along,
        period=track.points[0].period,
        points=tuple(_point(point, event) for point, event in zip(track.points, track.events, strict=True)),
        end=track.end,
        _family=branching.family,
        _recording=recording,
    )


def _point(point: Point, event: Event) -> BranchPoint:
    least_gap, least_force = least_of(point.revolutions)
    return BranchPoint(
        value=point.value,
        event=event.name.lower(),
        multipliers=point.multipliers,
        state=point.state,
        least_gap=least_gap,
        least_force=least_force,
        touches=sum(piece.touching.size for piece in point.pieces),
    )
