"""Modes that nothing damps, of masses, beams, matrices and carriers: what is named, and what is not."""

import math

import numpy as np
import pytest
from closed_form import read_rig

from rubhpc import assemble
from rubhpc.fem.modes import modes
from rubhpc.fem.stability import stator_names, undamped, undamped_message
from rubhpc.rig.reading import PACKAGED, with_keys

ROTOR = (PACKAGED / "mokhtar2017.toml").read_text().split("[[stator]]")[0]
MASS = '[[stator]]\ncount = 4\nnode = 8\nmass = "60 g"\nstiffness = "2e6 N/m"\ndamping = "60 N s/m"\n'
SOFT = 'lateral_stiffness = "1e6 N/m"\n'


def rig_of(tmp_path, stators, rotor=ROTOR):
    path = tmp_path / "rig.toml"
    path.write_text(rotor + stators)
    return read_rig(path)


def test_masses_without_lateral_damping_are_named_once(tmp_path):
    frequency = math.sqrt(1e6 / 0.06) / (2.0 * math.pi)
    text = undamped_message(assemble(rig_of(tmp_path, MASS + SOFT)), 200.0)
    assert text.startswith(
        f"no damping acts on the lateral mode of {frequency:.4g} Hz of stators 1 to 4: once excited"
    )
    assert "\n" not in text
    damped = rig_of(tmp_path, MASS + SOFT + 'lateral_damping = "1 N s/m"\n')
    assert undamped_message(assemble(damped), 200.0) == ""


def test_of_a_beam_all_modes_are_counted(tmp_path):
    rig = with_keys(read_rig("mokhtar2017"), {"stator.damping.beta": 0.0})
    model = assemble(rig)
    found = undamped(model.stators[0].body)
    assert len(found) == model.stators[0].body.n_dof
    assert f"18 modes, first the lateral mode of {found[0].frequency:.4g} Hz, of stator 1" in (
        undamped_message(model, 200.0)
    )


def test_a_rotor_that_bearings_damp_keeps_its_twist(tmp_path):
    """Bearings damp every lateral mode that moves them; axial modes nothing excites."""
    rotor = ROTOR.replace("alpha = 31.7", "alpha = 0.0").replace(
        "stiffness = 1e6", 'stiffness = 1e6\ndamping = "200 N s/m"'
    )
    model = assemble(rig_of(tmp_path, MASS, rotor))
    kinds = {mode.kind for mode in undamped(model.rotor, 200.0)}
    assert "torsional" in kinds
    assert "lateral" not in kinds
    torsion = next(m for m in modes(model.rotor, 200.0) if m.kind == "torsional")
    assert f"the torsional mode of {torsion.frequency:.4g} Hz, of the rotor" in undamped_message(model, 200.0)


def test_growth_is_no_lack_of_damping():
    keys = {"rotor.bearing.kyz": 5e4, "rotor.bearing.kzy": -5e4, "rotor.damping.alpha": 0.0}
    rotor = assemble(with_keys(read_rig("mokhtar2017"), keys)).rotor
    lateral = [mode for mode in undamped(rotor, 400.0) if mode.kind == "lateral"]
    assert all(abs(mode.damping_ratio) < 1e-8 for mode in lateral)
    assert len(lateral) < sum(mode.kind == "lateral" for mode in modes(rotor, 400.0))


@pytest.mark.parametrize(
    ("numbers", "name"),
    [([3], "stator 3"), ([1, 2], "stators 1 and 2"), ([1, 2, 3, 4, 6, 7], "stators 1 to 4, 6 and 7")],
)
def test_runs_of_stators_are_named_by_their_ends(numbers, name):
    assert stator_names(numbers) == name


def test_a_mode_that_decays_slowly_is_damped():
    body = assemble(with_keys(read_rig("mokhtar2017"), {"stator.damping.beta": 1e-9})).stators[0].body
    assert not undamped(body)
    assert np.linalg.eigvalsh(body.damping)[0] > 0.0


def test_stators_on_a_carrier_are_one_body_with_it(tmp_path):
    carrier = '[[carrier]]\nname = "casing"\nmass = "6 kg"\nstiffness = "8e5 N/m"\ndamping = "300 N s/m"\n'
    stators = MASS.replace("[[stator]]", '[[stator]]\ncarrier = "casing"') + SOFT
    model = assemble(rig_of(tmp_path, carrier + stators))
    (whole,) = model.carriers
    found = undamped(whole.body)
    assert 0 < len(found) < 4  # tangential motion that moves the casing is damped by it
    assert "of carrier casing with stators 1 to 4" in undamped_message(model, 200.0)
    assert undamped_message(model, 200.0).count("stator") == 1
