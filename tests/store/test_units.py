import numpy as np
import pytest
import xarray as xr

from postproc.store.units import caption, displayed
from rubhpc.input.quantity import parse_quantity
from rubhpc.units import scale_for, typed, typed_quantity, typeset


@pytest.mark.parametrize(
    ("unit", "size", "factor", "written"),
    [
        ("m", 84e-6, 1e6, "µm"),
        ("m", 1.8e-3, 1e6, "µm"),  # an orbit of 1800 µm is still read in µm
        ("m", 12e-3, 1e3, "mm"),
        ("rad", 4e-4, 1e6, "µrad"),
        ("rad", 6e-3, 1e3, "mrad"),
        ("N", 241.0, 1.0, "N"),
        ("N", 2700.0, 1e-3, "kN"),
        ("Pa", 30e9, 1e-9, "GPa"),
        ("s", 3e-3, 1e3, "ms"),
        ("rad s-2", 5e3, 1.0, "rad s⁻²"),
        ("1", 0.7, 1.0, ""),
        ("m", 0.0, 1.0, "m"),
        ("cd", 5e-7, 1.0, "cd"),  # an unknown unit stays as it is
        ("kg m2", 5.0, 1.0, "kg m²"),  # but for its powers
    ],
)
def test_quantities_are_shown_in_the_unit_that_suits_their_size(unit, size, factor, written):
    scale = scale_for(unit, size)
    assert (scale.factor, scale.unit) == (pytest.approx(factor), written)


def test_labels_name_the_quantity_and_its_unit():
    wave = xr.DataArray([-1e-4, 5e-5, np.nan], dims="sample", name="vertical", attrs={"units": "m"})
    values, label = displayed(wave)
    assert label == "Vertical displacement (µm)"
    assert values[:2] == pytest.approx([-100, 50])


def test_a_spectrum_is_named_as_its_signal():
    line = xr.DataArray([4e-4], dims="order", name="spectrum_torsion", attrs={"units": "rad"})
    assert displayed(line)[1] == "Torsion (µrad)"


def test_speeds_are_read_in_revolutions_per_minute():
    speed = xr.DataArray([np.pi, 2 * np.pi], dims="speed", name="speed", attrs={"units": "rad/s"})
    values, label = displayed(speed)
    assert values == pytest.approx([30, 60])
    assert label == "Spin speed (rpm)"


def test_a_caption_shows_what_was_selected():
    data = xr.Dataset(
        coords={
            "clearance": ((), 84e-6, {"units": "m"}),
            "speed_ratio": ((), 0.75, {"units": "1"}),
            "sample": ("sample", [0, 1]),
        }
    )
    assert caption(data).split("\n") == [
        r"$r$ = 0.75, $g$ = 84 µm,",
        "$r$: spin speed over first lateral frequency",
    ]


def test_a_caption_names_the_places_of_signals_and_writes_out_high_speeds():
    left = ("sample", [0.0], {"place": "left: node 3 at -45\N{DEGREE SIGN}"})
    data = xr.Dataset({"a": left, "b": left}, coords={"speed": ((), 1047.19755, {"units": "rad s-1"})})
    assert caption(data) == "$\\omega$ = 10000 rpm, left: node 3 at -45\N{DEGREE SIGN}"


def test_a_long_caption_takes_as_many_lines_as_it_needs():
    names = ("speed_ratio", "clearance_ratio", "friction", "rotor_disc_1_mass", "stator_1_angle", "stator")
    data = xr.Dataset(coords={name: ((), 0.75, {"units": "1"}) for name in names})
    lines = caption(data).split("\n")
    assert lines == [
        r"$r$ = 0.75, $c_g$ = 0.75, $\mu$ = 0.75, rotor disc 1 mass = 0.75,",
        "stator = 0.75, stator 1 angle = 0.75,",
        "$r$: spin speed over first lateral frequency,",
        "$c_g$: clearance over contact-free amplitude",
    ]


def test_angles_of_a_caption_are_in_degrees():
    angle = xr.Dataset(coords={"stator_angle": ((), np.pi / 4, {"units": "rad"})})
    assert caption(angle) == "stator angle = 45°"


@pytest.mark.parametrize("unit", ["m s-1", "kg m-3", "rad s-2", "N m-1", "m", "Pa"])
def test_a_displayed_unit_can_be_typed_back(unit):
    scale = scale_for(unit, 5e-5 if unit == "m" else 5e5)
    spelt = typed(scale.unit)
    assert spelt.isascii()
    known = typed(typeset(unit))  # in pint's spelling
    assert parse_quantity(f"{scale.factor:.17g} {spelt}", known, "here") == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (40 * np.pi, "rad s-1", "1200 rpm"),
        (84e-6, "m", "84 um"),
        (0.04, "m", "40 mm"),
        (-np.pi / 4, "rad", "-45 deg"),
        (3e9, "Pa", "3 GPa"),
        (1157.0, "kg m-3", "1157 kg/m^3"),
        (2e6, "N m-1", "2 MN/m"),
        (350.0, "N s m-1", "350 N*s/m"),
        (0.01, "kg m2", "0.01 kg*m^2"),
        (0.7, "1", "0.7"),
        (0.0, "m", "0 m"),
    ],
)
def test_a_setting_is_written_as_a_study_file_may_state_it(value, unit, text):
    assert typed_quantity(value, unit) == text
    if unit != "1":
        assert parse_quantity(text, typed(typeset(unit)), "here") == pytest.approx(value)
