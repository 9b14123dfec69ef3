"""Names and types of the variables of a record, for editors and type checkers."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

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
