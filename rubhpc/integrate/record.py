"""Result of a case: state before and after, signals, spectra and measures."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rubhpc.schema import (
    DONE,
    SCHEMES,
    STATUS,
    VARIABLES,
    bore_variables,
    lyapunov_variables,
    probe_variables,
)

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from rubhpc.fem.model import Model

    Floats = NDArray[np.float64]


class RecordVariables:
    """Attributes that a record finds among its signals, spectra, sections, measures and settings."""

    if TYPE_CHECKING:
        vertical: Floats  # (n_sample,); m
        horizontal: Floats  # (n_sample,); m
        torsion: Floats  # (n_sample,); rad
        torsion_acceleration: Floats  # (n_sample,); rad s-2
        stator_axial: Floats  # (n_stator, n_sample); m
        stator_lateral: Floats  # (n_stator, n_sample); m
        contact_force: Floats  # (n_stator, n_sample); N
        spectrum_vertical: Floats  # (n_order,); m
        spectrum_horizontal: Floats  # (n_order,); m
        spectrum_torsion: Floats  # (n_order,); rad
        spectrum_torsion_acceleration: Floats  # (n_order,); rad s-2
        spectrum_stator_axial: Floats  # (n_stator, n_order); m
        spectrum_stator_lateral: Floats  # (n_stator, n_order); m
        spectrum_contact_force: Floats  # (n_stator, n_order); N
        section_vertical: Floats  # (n_section,); m
        section_horizontal: Floats  # (n_section,); m
        section_torsion: Floats  # (n_section,); rad
        spin_speed: float  # rad s-1
        clearance: float  # m
        contact_free_amplitude: float  # m
        regime: int
        period: int
        lyapunov_exponent: float
        largest_multiplier: float
        multiplier_angle: float  # rad
        whirl_ratio: float
        contact_fraction: Floats  # (n_stator,)
        stick_fraction: Floats  # (n_stator,)
        rub_kind: Floats  # (n_stator,)
        whirl_frequency: Floats  # (n_stator,); rad s-1
        contact_angle_mean: Floats  # (n_stator,); rad
        contact_angle_spread: Floats  # (n_stator,)
        contact_arc: Floats  # (n_stator,); rad
        reversals_per_revolution: Floats  # (n_stator,)
        contacts_per_revolution: Floats  # (n_stator,)
        contact_duration: Floats  # (n_stator,); s
        peak_contact_force: Floats  # (n_stator,); N
        contact_impulse: Floats  # (n_stator,); N s
        friction_work: Floats  # (n_stator,); J
        minimum_slip_speed: Floats  # (n_stator,); m s-1
        force_over_euler_load: Floats  # (n_stator,)
        tip_deflection_ratio: Floats  # (n_stator,)
        foreshortening_ratio: Floats  # (n_stator,)
        normal_angle: Floats  # (n_stator,); rad
        force_over_strength: Floats  # (n_stator,)
        carrier_displacement: Floats  # (n_stator,); m
        bearing_clearance_ratio: float
        peak_torsion: float  # rad
        peak_to_peak_vertical: float  # m
        peak_to_peak_horizontal: float  # m
        energy_residual: float
        modal_error: float
        settled: int
        contact_iterations: int
        contact_residual: float
        transient_revolutions: int
        steps: int
        scheme: int
        left_closed_form: int
        wall_time: float  # s


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """Motion of rotor and stators at a whole revolution, in the degrees of their bodies (`Body.degrees`).

    Attributes
    ----------
    rotor_displacement, rotor_velocity : (n_rotor_dof,)
        m or rad, m/s or rad/s, in the frame that spins steadily.
    stator_displacement, stator_velocity : tuple of (n_stator_dof,)
        m or rad, m/s or rad/s.
    contact_force : (n_stator,), N
        Normal force at that instant; it determines the acceleration with which a run continues.
    overlap : (n_stator,), m
        How far disc and tip overlap at that instant, under a penalty; zero by default.
    """

    rotor_displacement: Floats
    rotor_velocity: Floats
    stator_displacement: tuple[Floats, ...]
    stator_velocity: tuple[Floats, ...]
    contact_force: Floats
    overlap: Floats | None = None

    @property
    def displacement(self) -> Floats:
        """Of all bodies, rotor first, (n_dof,), m or rad."""
        return np.concatenate([self.rotor_displacement, *self.stator_displacement])

    @property
    def velocity(self) -> Floats:
        """Of all bodies, rotor first, (n_dof,), m/s or rad/s."""
        return np.concatenate([self.rotor_velocity, *self.stator_velocity])

    def packed(self) -> Floats:
        """All of it as one vector (`fem.model.state_size`)."""
        overlap = np.zeros_like(self.contact_force) if self.overlap is None else self.overlap
        return np.concatenate([self.displacement, self.velocity, self.contact_force, overlap])

    @classmethod
    def unpacked(cls, values: Floats, model: Model) -> State:
        """The state of a model from the vector of `packed`."""
        n_dof, n_stator = model.body_start[-1], len(model.stators)
        parts = np.split(values, np.cumsum([n_dof, n_dof, n_stator]))
        return cls.of_bodies(model, *parts)

    @classmethod
    def of_bodies(
        cls,
        model: Model,
        displacement: Floats,
        velocity: Floats,
        contact_force: Floats,
        overlap: Floats | None = None,
    ) -> State:
        """The state with these vectors over all bodies, (n_dof,), and over the contacts, (n_stator,)."""
        u, v = model.split(displacement), model.split(velocity)
        return cls(
            rotor_displacement=u[0],
            rotor_velocity=v[0],
            stator_displacement=tuple(u[1:]),
            stator_velocity=tuple(v[1:]),
            contact_force=contact_force,
            overlap=overlap,
        )

    @classmethod
    def at_rest(cls, model: Model) -> State:
        """Return the state of rest: steady spin, shaft bent by constant loads, no contact."""
        n_dof = model.body_start[-1]
        displacement = np.zeros(n_dof)
        displacement[: model.rotor.n_dof] = model.sag
        return cls.of_bodies(model, displacement, np.zeros(n_dof), np.zeros(len(model.stators)))


MOST_RESIDUAL = 0.01  # of the energy balance: a larger one is reported


@dataclass(frozen=True, kw_only=True, eq=False)
class Record(RecordVariables):
    """One simulated case; every stored variable is an attribute (`record.vertical`, `record.period`).

    Type checkers do not know the names of probes and Lyapunov spectra: use `signals` and `measures` for
    these.

    Attributes
    ----------
    status : int
        `schema.DONE` or `schema.DIVERGED`; a diverged case says why in `reason` and holds its signals and
        sections up to there, then NaN.
    note : str
        What is wrong with the rig at this speed: an unstable rotor.
    advice : str
        What to do where `modal_error` is above the accuracy asked for.
    signals : dict of (n_sample,) or (n_stator, n_sample)
        Shaft-locked samples over the recorded revolutions, SI units as in `rubhpc.schema`.
    spectra : dict of (n_order,) or (n_stator, n_order)
        Single-sided amplitudes, zero to peak, named `spectrum_*`.
    sections : dict of (n_revolution,)
        Poincaré sections (one point a revolution), named `section_*`.
    measures : dict of float, int or (n_stator,)
        Everything else of the schema.
    settings : dict of float
        `spin_speed` (rad/s) and `clearance` (m).
    final : State
        Final state; as `initial=` of another run it continues the motion.
    probed : tuple of (name, quantity)
        Its probes.
    n_exponent : int
        How many Lyapunov exponents were measured by the exact tangent map.
    """

    status: int = DONE
    reason: str = ""
    note: str = ""
    advice: str = ""
    samples_per_revolution: int
    signals: dict[str, Floats] = field(default_factory=dict)
    spectra: dict[str, Floats] = field(default_factory=dict)
    sections: dict[str, Floats] = field(default_factory=dict)
    measures: dict[str, Any] = field(default_factory=dict)
    settings: dict[str, float] = field(default_factory=dict)
    final: State
    probed: tuple[tuple[str, str], ...] = ()
    n_exponent: int = 0

    def _groups(self) -> tuple[dict[str, Any], ...]:
        return self.signals, self.spectra, self.sections, self.measures, self.settings

    def copied(self) -> Record:
        """Return the record with copies of its arrays, except the final state."""
        own = [
            {name: value.copy() if isinstance(value, np.ndarray) else value for name, value in group.items()}
            for group in (self.signals, self.spectra, self.sections, self.measures)
        ]
        return replace(self, signals=own[0], spectra=own[1], sections=own[2], measures=own[3])

    def __dir__(self) -> list[str]:
        """Return all attributes, the variables that this record holds among them."""
        return sorted({*super().__dir__(), *(name for group in self._groups() for name in group)})

    if not TYPE_CHECKING:  # type checkers know the names from `RecordVariables`

        def __getattr__(self, name: str) -> Any:
            """Return a variable by its name in the schema."""
            if not name.startswith("_"):
                for group in self._groups():
                    if name in group:
                        return group[name]
            raise AttributeError(f"this record contains no {name}")

    @property
    def remark(self) -> str:
        """Why the case diverged, or what is wrong with its result; "" where nothing is."""
        residual = self.measures.get("energy_residual", 0.0)
        texts = [text for text in (self.reason, self.note) if text]
        if not self.reason and residual > MOST_RESIDUAL:
            is_stepped = self.measures.get("scheme") == SCHEMES.index("central_difference")
            fix = "a shorter step" if is_stepped else "a smaller accuracy"
            texts.append(f"its energy balance is off by {100 * residual:.2g} %; use {fix}")
        if not self.reason and self.advice:
            texts.append(self.advice)
        return "; ".join(texts)

    def __repr__(self) -> str:
        """One line: status and what it holds."""
        reason = f" ({self.remark})" if self.remark else ""
        held = ", ".join((*self.signals, *self.spectra, *self.sections))
        return f"<Record: {STATUS[self.status]}{reason}; {held or 'measures only'}>"

    def to_dataset(self) -> xr.Dataset:
        """Return the record as a dataset with units, laid out like a store of one case."""
        import xarray as xr

        arrays = {**self.signals, **self.spectra, **self.sections, **self.measures, **self.settings}
        variables = (
            VARIABLES | bore_variables() | probe_variables(self.probed) | lyapunov_variables(self.n_exponent)
        )
        dataset = xr.Dataset(
            {
                name: (
                    variables[name].dims,
                    np.asarray(value),
                    {"units": variables[name].unit, "long_name": variables[name].long_name},
                )
                for name, value in arrays.items()
            }
        )
        for dim, per_revolution in (("sample", self.samples_per_revolution), ("section", 1)):
            if dim in dataset.sizes:
                name = "revolution" if dim == "sample" else "section"
                values = np.arange(dataset.sizes[dim]) / per_revolution
                dataset = dataset.assign_coords(
                    {name: (dim, values, {"units": "1", "long_name": "revolution"})}
                )
        if "order" in dataset.sizes:
            n_order = dataset.sizes["order"]
            orders = np.arange(n_order) * (0.5 * self.samples_per_revolution / (n_order - 1))
            dataset = dataset.assign_coords(
                order=("order", orders, {"units": "1", "long_name": "order of the spin frequency"})
            )
        dataset.attrs |= {"status": STATUS[self.status], "reason": self.reason}
        return dataset
