"""One case from its arguments to its record: units, refusals, continuation, divergence, energy."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from closed_form import read_rig, simulate
from set_ups import prepared

import rubhpc
from rubhpc import InputError, State
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency, step_limit
from rubhpc.integrate.case import run_case
from rubhpc.integrate.marches import march
from rubhpc.rig.reading import PACKAGED, with_keys
from rubhpc.schema import DONE, SECTION_NAMES, SIGNAL_NAMES, VARIABLES
from rubhpc.spectra import amplitude_spectrum
from rubhpc.study.study import Recording

RIG = read_rig("mokhtar2017")
MODEL = assemble(RIG)
SPEED = 148.7
# In contact from the first revolution on, at a quarter of the usual work.
RUB = {
    "speed": SPEED,
    "clearance": 60e-6,
    "method": "central-difference",
    "step": 2e-6,
    "transient": 0,
    "revolutions": 2,
}
THREE = tuple(replace(RIG.stator[0], angle=angle) for angle in (0.0, 0.4, -1.5))


def same(one, other):
    """Whether two records hold the same to the last bit, wall time apart."""
    groups = ("signals", "spectra", "sections", "measures")
    held = [{k: v for group in groups for k, v in getattr(r, group).items()} for r in (one, other)]
    assert held[0].keys() == held[1].keys()
    return all(
        np.array_equal(held[0][name], held[1][name], equal_nan=True)
        for name in held[0]
        if name != "wall_time"
    )


def test_same_case_is_the_same_to_the_last_bit_however_it_is_said(tmp_path):
    file = tmp_path / "bench.toml"
    file.write_text((PACKAGED / "mokhtar2017.toml").read_text())
    plain = simulate(RIG, **RUB)
    unit = first_lateral_frequency(MODEL)
    free = contact_free_amplitude(MODEL, SPEED)
    assert plain.settings == {"spin_speed": SPEED, "clearance": 60e-6, "contact_free_amplitude": free}
    assert same(plain, simulate("mokhtar2017", **(RUB | {"clearance": "60 um", "step": "2 us"})))
    assert same(plain, simulate(file, **(RUB | {"speed": f"{SPEED} rad/s"})))
    ratios = {"speed_ratio": SPEED / unit, "clearance_ratio": 60e-6 / free}
    rest = {k: v for k, v in RUB.items() if k not in ("speed", "clearance")}
    by_ratio = simulate(RIG, **rest, **ratios)
    assert by_ratio.spin_speed == pytest.approx(SPEED, rel=1e-14)
    assert by_ratio.vertical == pytest.approx(plain.vertical, rel=1e-9, abs=1e-15)


def test_overrides_change_the_rig():
    changed = with_keys(RIG, {"stator.youngs_modulus": 1e9, "rotor.unbalance.mass": 0.004})
    overrides = {"stator.youngs_modulus": "1 GPa", "rotor.unbalance.mass": "4 g"}
    assert same(simulate(RIG, **RUB, overrides=overrides), simulate(changed, **RUB))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"speed_ratio": 1.0}, "speed or speed_ratio"),
        ({"speed": None}, "speed or speed_ratio"),
        ({"clearance_ratio": 0.7}, "clearance or clearance_ratio"),
        ({"clearance": None}, "clearance or clearance_ratio"),
        (
            {"clearance": None, "clearance_ratio": 0.0},
            "clearance_ratio: 0 m and .* leave no gap; give clearance",
        ),
        ({"clearance": math.nan}, "not finite"),
        ({"clearance": "60 rpm"}, "not in m"),
        ({"friction": math.nan}, "friction: nan is not finite"),
        ({"speed": 0.0}, "has to turn"),
        ({"speed": math.inf}, "not finite"),
        ({"overrides": {"stator.modulus": 1e9}}, "unknown key"),
        ({"overrides": ["stator.length"]}, "overrides: .* is not a dict; give one such as"),
        ({"keep": None}, "simulate: keep: None is not a list of names"),
        ({"revolutions": np.float64(1.5)}, "revolutions: 1.5 is not a whole number"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(changed, message):
    with pytest.raises(InputError, match=message) as refusal:
        simulate(RIG, **(RUB | changed))
    assert "\n" not in str(refusal.value)


def test_numbers_and_arrays_of_numpy_are_taken_as_pythons():
    table = {"friction_law": "table", "slip_speed": [0.0, 1.0], "friction_ratio": [1.2, 1.0]}
    counted = {"transient": 1, "revolutions": 2, "samples_per_revolution": 32}
    arrays = {name: np.array(value) for name, value in table.items() if name != "friction_law"}
    one = simulate(RIG, **(RUB | table | counted))
    other = simulate(RIG, **(RUB | table | arrays | {name: np.int64(n) for name, n in counted.items()}))
    assert same(one, other)
    assert json.dumps(other.settings) == json.dumps(one.settings)


def test_rig_without_stator_is_refused():
    with pytest.raises(InputError, match="at least one"):
        simulate(replace(RIG, stator=(), rotor=RIG.rotor), **RUB)


@pytest.mark.parametrize("modulus", [3e9, 30e9])
def test_step_above_the_limit_is_refused_with_the_limit(modulus):
    overrides = {"stator.youngs_modulus": modulus}
    limit = step_limit(assemble(with_keys(RIG, overrides)))
    with pytest.raises(InputError, match=f"use less than {limit:.4g} s"):
        simulate(RIG, **(RUB | {"step": limit * 1.001}), overrides=overrides)
    # as long as it may be; the samples' interval then shortens it by 0.3 % at most
    record = simulate(
        RIG, **(RUB | {"step": limit * 0.9999, "samples_per_revolution": 64}), overrides=overrides
    )
    taken = 2 * 2 * math.pi / SPEED / record.steps
    assert 0.997 * limit < taken < limit
    assert record.status == DONE
    assert record.peak_to_peak_vertical < 5e-4


@pytest.mark.parametrize(("modulus", "expected"), [(3e9, 0.5e-6), (300e9, None)])
def test_step_left_open_is_the_papers_or_a_share_of_the_limit(modulus, expected):
    rig = with_keys(RIG, {"stator.youngs_modulus": modulus})
    setup = prepared(rig, SPEED, samples=256, method="central-difference")
    wanted = expected or 0.9 * step_limit(setup.model)
    assert 0.99 * wanted < setup.step <= wanted
    assert setup.step * setup.steps_per_sample * 256 == pytest.approx(2 * math.pi / SPEED, rel=1e-14)


def test_record_holds_what_the_schema_names():
    record = simulate(RIG, **RUB)
    roles = {variable.name for variable in VARIABLES.values() if variable.role == "measure"}
    assert set(record.measures) == roles | {"regime"}
    assert set(record.signals) == set(SIGNAL_NAMES)
    assert record.status == DONE
    assert record.steps == 2 * 256 * math.ceil(2 * math.pi / SPEED / 256 / 2e-6)
    for name in SIGNAL_NAMES:
        signal = getattr(record, name)
        assert signal.shape == ((1, 512) if "stator" in VARIABLES[name].dims else (512,))
        assert np.array_equal(record.spectra[f"spectrum_{name}"], amplitude_spectrum(signal))
    for name in SECTION_NAMES:
        assert np.array_equal(record.sections[f"section_{name}"], getattr(record, name)[::256])


@pytest.mark.parametrize("keep", [(), ("section",), ("spectrum", "waveform")])
def test_record_keeps_what_it_is_reported(keep):
    record = simulate(RIG, **RUB, keep=keep)
    held = {"waveform": record.signals, "spectrum": record.spectra, "section": record.sections}
    assert {name for name, group in held.items() if group} == set(keep)
    assert record.period in range(17)


def test_scalars_agree_with_the_signals():
    record = simulate(RIG, **(RUB | {"samples_per_revolution": 4096}))
    turn = 2 * math.pi / SPEED
    assert record.contact_impulse[0] == pytest.approx(record.contact_force.mean() * turn, rel=1e-12)
    assert record.peak_to_peak_vertical == pytest.approx(np.ptp(record.vertical), rel=1e-5)
    assert record.peak_to_peak_horizontal == pytest.approx(np.ptp(record.horizontal), rel=1e-5)
    assert record.peak_torsion == pytest.approx(abs(record.torsion).max(), rel=1e-4)
    assert record.tip_deflection_ratio[0] == pytest.approx(abs(record.stator_lateral).max() / 0.04, rel=1e-4)
    assert record.peak_contact_force[0] == pytest.approx(record.contact_force.max(), rel=0.02)
    euler = math.pi**2 * 3e9 * 5e-3**4 / 12 / (4 * 0.04**2)
    assert record.force_over_euler_load[0] == pytest.approx(record.peak_contact_force[0] / euler)
    touching = np.count_nonzero(record.contact_force) / record.contact_force.size
    assert record.contact_fraction[0] == pytest.approx(touching, abs=0.002)
    contacts = record.contacts_per_revolution[0] * 2
    assert contacts == np.count_nonzero(np.diff((record.contact_force[0] > 0).astype(int)) == 1)
    assert record.contact_duration[0] * contacts == pytest.approx(record.contact_fraction[0] * 2 * turn)
    rub = 0.3 * record.contact_force[0].mean() * turn * 0.06 * SPEED  # at the rim's steady speed
    assert record.friction_work[0] == pytest.approx(rub, rel=0.05)
    assert record.minimum_slip_speed[0] < 0.06 * SPEED


def test_transient_is_run_but_not_recorded():
    late = simulate(RIG, **(RUB | {"transient": 1, "revolutions": 1}))
    whole = simulate(RIG, **RUB)
    assert np.array_equal(late.vertical, whole.vertical[256:])
    assert late.steps == whole.steps


def run(*, rig=RIG, normal="fixed", change=lambda setup: setup, **options):
    setup = prepared(rig, SPEED, samples=256, method="central-difference", step=2e-6, normal=normal)
    recording = Recording(transient=1, revolutions=2)
    return run_case(
        change(setup), **({"clearance": 60e-6, "friction": 0.3, "recording": recording} | options)
    )


def test_shorter_kernel_calls_change_nothing(monkeypatch):
    calls = {"long": 0, "short": 0}

    def count(kind):
        def check():
            calls[kind] += 1

        return check

    usual = run(check=count("long"))
    monkeypatch.setattr(march, "LONGEST_CALL", 1e-3)
    pieces = run(check=count("short"))
    assert calls["short"] > 2 * calls["long"] > 0
    assert same(usual, pieces)


def test_a_case_says_where_it_is():
    said = []
    run(check=lambda: None, say=said.append)
    assert said[0] == "a case at revolution -1, its record begins at 0"
    assert said[-1] == "a case at revolution 0 of its record"


def test_check_may_drop_the_case():
    class StopError(Exception):
        pass

    def check():
        raise StopError

    with pytest.raises(StopError):
        run(check=check)


def stiffer(setup):
    """The same, but that the equations of motion take a hundredth more stiffness than the energy counts."""
    linear = setup.packed.linear
    packed = replace(setup.packed, linear=linear._replace(stiffness=linear.stiffness * 1.01))
    return replace(setup, packed=packed)


@pytest.mark.parametrize("normal", ["fixed", "updated"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("stators", [RIG.stator, THREE], ids=len)
def test_energy_balances(normal, friction, stators):
    given = {"rig": replace(RIG, stator=stators), "normal": normal, "friction": friction}
    sound, unsound = run(**given), run(**given, change=stiffer)
    assert sound.peak_contact_force.max() > 5.0
    assert sound.energy_residual < 1e-4
    assert unsound.energy_residual > 10 * sound.energy_residual


def test_motion_without_contact_is_reported_as_such():
    response = {"clearance": 1e-3, "revolutions": 1, "transient": 0}
    record = simulate(RIG, **(RUB | response))
    assert record.regime == 0
    assert np.isnan(record.minimum_slip_speed).all()
    for name in ("contact_duration", "contact_fraction", "contact_impulse", "peak_contact_force"):
        assert getattr(record, name).tolist() == [0.0]


def test_state_at_rest_is_where_a_run_begins():
    assert same(simulate(RIG, **RUB), simulate(RIG, **RUB, initial=State.at_rest(MODEL)))


@pytest.mark.parametrize("function", [rubhpc.simulate, rubhpc.periodic, rubhpc.branch, rubhpc.run_up])
def test_a_model_is_an_argument(function):
    given = {rubhpc.branch: {"along": "friction", "start": 0.1, "stop": 0.2}}
    given = given.get(function, {}) | {"model": "mokhtar2017", "normal": "updated", "clearance": "84 um"}
    given |= {"start": 90.0, "stop": 99.0, "time": 1.0} if function is rubhpc.run_up else {}
    with pytest.raises(InputError, match='normal: "updated" conflicts with model = "mokhtar2017"'):
        function("mokhtar2017", **({"speed": 90.0} if function is not rubhpc.run_up else {}), **given)


def test_a_model_is_what_its_keys_are_and_what_the_central_difference_needs():
    assert same(rubhpc.simulate("mokhtar2017", **RUB, model="mokhtar2017"), simulate("mokhtar2017", **RUB))
    with pytest.raises(
        InputError, match=r'method: central-difference .* add \[contact\] model = "mokhtar2017"'
    ):
        rubhpc.simulate("mokhtar2017", **RUB)
