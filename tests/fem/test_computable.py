"""Rigs whose matrices leave the floating-point range, or the memory, are refused in one line."""

from __future__ import annotations

import pytest
from closed_form import read_rig

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.modes import modes
from rubhpc.rig.reading import rig_from_dict, with_keys


@pytest.mark.parametrize(
    "shaft",
    [
        {"shear_modulus": 1e29},  # Poisson's ratio rounds to -1
        {
            "youngs_modulus": 1e30,
            "shear_modulus": 1e-30,
            "outer_diameter": 1e25,
            "length": 1e-30,
        },  # overflows
    ],
)
def test_values_far_apart_are_refused(shaft):
    rig = with_keys(read_rig("mokhtar2017"), {f"rotor.shaft.{key}": value for key, value in shaft.items()})
    with pytest.raises(InputError) as refused:
        assemble(rig)
    problem = "lengths, stiffnesses or densities are too far apart to compute with"
    assert str(refused.value) == f"[rotor]: {problem}; correct them"


def test_a_shaft_as_thick_as_a_planet_has_no_modes():
    rig = with_keys(read_rig("mokhtar2017"), {"rotor.shaft.outer_diameter": 5.6e23})
    with pytest.raises(InputError, match=r"\A(modes|\[rotor\]): .* too far apart to compute with; correct"):
        modes(assemble(rig).rotor)


def test_a_ring_of_too_many_elements_is_refused():
    table = read_rig("mokhtar2017").as_dict()
    table["stator"][0] |= {"count": 62, "elements": 16}
    with pytest.raises(InputError, match=r"mokhtar2017: .* more than 3000 degrees of freedom; use fewer"):
        assemble(rig_from_dict(table))
    table["stator"][0] |= {"elements": 15}
    assert len(assemble(rig_from_dict(table)).stators) == 62
