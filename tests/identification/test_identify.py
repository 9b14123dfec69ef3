"""What is behind a record: a rub, by another scheme than the one that fits, misalignment, or nothing."""

import re
import sys

import numpy as np
import pytest
import rubbing_machine
import xarray as xr
from click.testing import CliRunner

import rubhpc
from rubhpc.commands.identify import identify
from rubhpc.errors import InputError
from rubhpc.identification import evaluation
from rubhpc.identification.identify import FIRST_LOOK, MOST_OF_OTHERS, of_contenders
from rubhpc.identification.nested import Sampled
from rubhpc.identification.problem import read_problem
from rubhpc.identification.words import _verdict

SMALL = {"live": 16, "draws": 200}


@pytest.fixture(scope="module")
def rub(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rub")
    return rubbing_machine.write(folder, rubbing_machine.rubbing(40, 0.05))


@pytest.fixture(scope="module")
def found(rub, tmp_path_factory):
    folder = tmp_path_factory.mktemp("found")
    return folder, rubhpc.identify(*rub, output=folder, **SMALL)


def test_a_rub_is_found_with_its_clearance_and_friction(found):
    _, one = found
    text = "\n".join(one.lines)
    assert "it is a rub: odds of more than a million to 1" in text
    assert "stator 1 at node 8: touches with a probability of 1" in text
    draws = one.tree["posterior"]
    assert float(draws["clearance"].mean()) == pytest.approx(139.2161e-6, rel=0.02)
    assert float(draws["friction"].mean()) == pytest.approx(rubbing_machine.FRICTION, rel=0.05)
    assert draws["clearance"].attrs["units"] == "m"
    assert float(draws["contact_fraction"].mean()) == pytest.approx(0.198, abs=0.01)


def test_the_posterior_is_inference_data_with_what_it_predicts(found):
    import arviz

    folder, one = found
    stored = arviz.from_netcdf(folder / "posterior.nc")
    groups = {"posterior", "prior", "sample_stats", "posterior_predictive", "observed_data"}
    assert groups <= set(stored.groups())
    assert float(arviz.summary(stored.posterior[["friction"]])["mean"].iloc[0]) == pytest.approx(
        0.3, abs=0.02
    )
    seen, predicted = (
        one.tree[group]["spectrum_torsion"] for group in ("observed_data", "posterior_predictive")
    )
    first = int(np.flatnonzero(np.isclose(seen["order"], 1.0))[0])
    assert predicted.values[..., first] == pytest.approx(float(seen[first]), rel=0.05)


def test_an_interrupted_identification_goes_on_and_ends_alike(rub, found, tmp_path, monkeypatch):
    _, whole = found
    computed = evaluation.Evaluator.outcome
    calls = []

    def killed(self, values):
        if self.evaluated.of(values) is None:
            calls.append(1)
        if len(calls) == 150:
            raise KeyboardInterrupt
        return computed(self, values)

    monkeypatch.setattr(evaluation.Evaluator, "outcome", killed)
    with pytest.raises(KeyboardInterrupt):
        rubhpc.identify(*rub, output=tmp_path, **SMALL)
    assert len(calls) == 150
    calls[:] = [1] * 1000
    again = rubhpc.identify(*rub, output=tmp_path, **SMALL)
    assert again.tree["posterior"].equals(whole.tree["posterior"])
    assert again.lines == whole.lines
    n_case = sum(path.stat().st_size for path in (tmp_path / "cases").iterdir())
    assert n_case == sum(path.stat().st_size for path in (found[0] / "cases").iterdir())  # none twice


@pytest.mark.parametrize("kind", ["healthy", "misaligned"])
def test_what_is_not_a_rub_is_said(tmp_path, kind):
    columns = rubbing_machine.linear(kind == "misaligned", 40, 0.05)
    files = rubbing_machine.write(tmp_path, columns)
    one = rubhpc.identify(*files, **SMALL)
    evidence = one.tree["evidence"]["log_evidence"].to_series()
    text = "\n".join(one.lines)
    if kind == "misaligned":
        assert "it is not a rub: odds of more than a million to 1 against one" in text
        assert "it is misalignment: odds of more than a million to 1 against no rub" in text
        assert evidence["misalignment"] > max(evidence["rub"], evidence["no rub"]) + 10
    else:
        assert "it is not a rub: odds of more than a million to 1 against one" in text
        assert (
            "it is probably no other fault: odds of" in text
        )  # against misalignment, whose force may be small
        assert max(evidence["no rub"], evidence["misalignment"]) > evidence["rub"] + 10


@pytest.mark.parametrize("node", [1, 4, 15])
def test_misalignment_is_found_wherever_it_acts(tmp_path, node):
    problem = read_problem(*rubbing_machine.write(tmp_path, rubbing_machine.linear(True, 40, 0.05, node)))
    healthy, misaligned = problem.others
    assert misaligned.log_likelihood([]) > healthy.log_likelihood([]) + 50
    seen, unknown = problem.comparison.of(misaligned.waves([])), misaligned.unknown([])
    assert problem.comparison.misfit(seen, unknown) < 1.5


def test_a_clearance_that_may_be_wide_does_not_hide_a_healthy_machine(tmp_path):
    columns = rubbing_machine.linear(False, 40, 0.05)
    study = rubbing_machine.STUDY.replace('stop = "150 um"', 'stop = "400 um"')
    files = rubbing_machine.write(tmp_path, columns, study)
    text = "\n".join(rubhpc.identify(*files, **SMALL).lines)
    assert "it is not a rub: odds of more than a million to 1 against one" in text
    files[1].write_text(study.replace('"120 um"', '"300 um"'))
    text = "\n".join(rubhpc.identify(*files, **SMALL).lines)
    assert "no case of [grid] touches, so that a rub has not been tried" in text
    assert "it is probably no other fault" in text


SLACK_RIG = """
name = "slack"
[rotor]
gravity = "9.81 m/s^2"
clearance_from = "standstill"
[[rotor.shaft]]
length = "0.4 m"
outer_diameter = "20 mm"
elements = 4
youngs_modulus = "206 GPa"
poissons_ratio = 0.3
density = 7850.0
[[rotor.disc]]
node = 3
diameter = "0.16 m"
thickness = "20 mm"
density = 7850.0
[[rotor.bearing]]
position = 0.0
stiffness = 4e6
damping = "150 N s/m"
mass = "0.2 kg"
[[rotor.bearing]]
node = 5
stiffness = 4e6
damping = "150 N s/m"
[[rotor.unbalance]]
node = 3
mass = "3 g"
radius = "8 cm"
[rotor.torsion]
fixed_node = 1
[rotor.damping]
alpha = 15.0
[[carrier]]
name = "casing"
mass = "20 kg"
stiffness = "1e8 N/m"
[[stator]]
carrier = "casing"
kind = "bore"
node = 3
mass = "5 kg"
stiffness = "1e7 N/m"
"""


SLACK_STUDY = """
rig = "rig.toml"
[grid]
clearance = { start = "10 um", stop = "90 um" }
friction = 0.2
"rotor.unbalance.mass" = "2 g"
"rotor.bearing.stiffness" = [1e6, 4e6, 9e6]
"""


def test_slack_bearings_take_the_place_of_springs(tmp_path):
    files = rubbing_machine.write(tmp_path, rubbing_machine.linear(False, 40, 0.05), SLACK_STUDY)
    (tmp_path / "rig.toml").write_text(SLACK_RIG)
    problem = read_problem(*files, slack=True)
    others = problem.others[2:]
    assert [other.name for other in others] == [f"slack bearing at node {n}" for n in (1, 5)]
    rig = others[0].machine.study.rig
    assert [bearing.stiffness_matrix[0][0] for bearing in rig.rotor.bearing] == pytest.approx([4e3, 4e6])
    assert rig.rotor.bearing[0].mass == 0.2
    assert rig.rotor.unbalance[0].mass == pytest.approx(2e-3)  # known by the study
    _, wall = rig.stator
    assert (wall.node, wall.law.stiffness) == (1, pytest.approx(4e6))
    assert rig.rotor.clearance_from == "unloaded"  # not a loose shaft's sag of millimetres
    # The springs of bearings are no open keys: they would make the slack one stiff again.
    assert [prior.name for prior in others[0].priors] == ["clearance", "stator.2.law.stiffness"]
    outcome = others[0].outcome([prior.at(0.5) for prior in others[0].priors])
    assert outcome.contact_fraction[0] == 0.0
    assert outcome.contact_fraction[1] > 0.1


def test_a_slack_bearing_explains_its_record(tmp_path):
    columns = rubbing_machine.linear(False, 40, 0.05)
    del columns["torsion"]
    files = rubbing_machine.write(tmp_path, columns, SLACK_STUDY)
    (tmp_path / "rig.toml").write_text(SLACK_RIG)
    true, values = read_problem(*files, slack=True).others[3], [40e-6, 5e6]
    signals = true.machine.simulate(values).to_dataset()
    sensors = {
        name: rubhpc.Sensor(white=0.02 * float(signals[name].std())) for name in columns.keys() & signals
    }
    rate = 200.37 * float(signals["spin_speed"]) / (2 * np.pi)
    seen = rubhpc.sense(signals, sensors, rate=rate, seed=3)
    rubbing_machine.write(tmp_path, {name: seen[name].values for name in columns}, SLACK_STUDY)
    problem = read_problem(*files, slack=True)
    healthy, misaligned, other, same = problem.others
    outcome = same.outcome(values)
    assert problem.comparison.misfit(outcome.seen) < 1.5
    springs = [prior.at(0.5) for prior in healthy.priors]  # of the bearings
    logs = [one.log_likelihood(springs) for one in (healthy, misaligned)]
    most = max(*logs, other.log_likelihood(other.outcome(values)))
    assert same.log_likelihood(outcome) > most + 50


def test_a_rig_without_springs_has_no_slack_bearings(tmp_path):
    study = SLACK_STUDY.replace('"rotor.bearing', '# "rotor.bearing')
    files = rubbing_machine.write(tmp_path, rubbing_machine.linear(False, 40, 0.05), study)
    table = "speed = [10.0, 900.0]\nkyy = [4e6, 4e6]\nkzz = [4e6, 4e6]\n"
    (tmp_path / "rig.toml").write_text(SLACK_RIG.replace("stiffness = 4e6\n", table))
    with pytest.raises(InputError, match="slack: no bearing of the rig has springs to the ground"):
        read_problem(*files, slack=True)


def test_a_speed_that_is_known_roughly_is_refined(tmp_path):
    columns = rubbing_machine.linear(True, 40, 0.05)
    del columns["key_phasor"]
    measured, study = rubbing_machine.write(tmp_path, columns)
    measured.write_text(measured.read_text().replace(f"{rubbing_machine.SPIN} rad/s", "299 rad/s"))
    problem = read_problem(measured, study)
    assert problem.channels.spin == pytest.approx(rubbing_machine.SPIN, rel=2e-5)  # a thousandth of a bin
    assert "repeats" in problem.comparison.about
    assert problem.channels.angle_error == np.inf


def test_only_contenders_are_sampled_to_the_end():
    ends = {
        "far": 100.0,
        "best": 300.0,
        "near": 260.0,
        "whole": 299.0,
    }  # ln(likelihood)
    looks = []

    def look(name, most):
        looks.append((name, most))
        likeliest = ends[name] - (20.0 if most == FIRST_LOOK else 0.0)
        only = np.zeros((1, 1)), np.zeros(1), np.zeros(1), np.array([likeliest])
        is_whole = name == "whole" or most == MOST_OF_OTHERS
        return Sampled(*only, log_evidence=likeliest - 8.0, error=1.0, n_call=1, is_whole=is_whole)

    found = of_contenders(look, list(ends), 150.0)
    assert list(found) == list(ends)
    assert looks[len(ends) :] == [("best", MOST_OF_OTHERS)]
    assert found["best"].log_evidence == 292.0
    looks.clear()
    of_contenders(look, ["far", "near"], 150.0)
    assert looks[2:] == [("near", MOST_OF_OTHERS)]
    looks.clear()
    of_contenders(look, ["far", "near"], 300.0)
    assert len(looks) == 2


def test_ties_among_other_faults_are_said():
    one, other = "slack bearing at node 1", "slack bearing at node 5"
    evidence = {"rub": (0.0, 0.1), "no rub": (-50.0, 0.1), one: (30.0, 0.5), other: (30.4, 0.5)}
    assert list(_verdict(evidence, "rub"))[1:] == [
        f"the data do not distinguish {other} from {one}",
        "it is one of these: odds of more than a million to 1 against no rub",
    ]
    assert list(_verdict(evidence | {one: (0.0, 0.5)}, "rub"))[1:] == [
        f"it is a {other}: odds of more than a million to 1 against {one}"
    ]


def test_another_speed_than_that_of_the_record_is_refused(tmp_path):
    columns = rubbing_machine.linear(True, 40, 0.05)
    del columns["key_phasor"]
    measured, study = rubbing_machine.write(tmp_path, columns)
    measured.write_text(measured.read_text().replace(f"{rubbing_machine.SPIN} rad/s", "330 rad/s"))
    with pytest.raises(InputError, match=r"probe.csv: \[speed\]: no line is within 2 % of it"):
        read_problem(measured, study)


def test_broken_sensors_are_left_out(tmp_path):
    columns = rubbing_machine.linear(True, 40, 0.05)
    columns["torsion"][:] = -0.3
    columns["horizontal"][columns["time"].size // 3 :] = 0.0
    problem = read_problem(*rubbing_machine.write(tmp_path, columns))
    assert problem.channels.names == ("vertical",)
    assert "column torsion: is -0.3 throughout; check the sensor" in problem.note
    assert "horizontal: changes its size by more than a factor of 3; left out" in problem.note
    columns["vertical"][columns["time"].size // 3 :] *= 0.1
    with pytest.raises(InputError, match="the size of the motion changes by more than a factor of 3"):
        read_problem(*rubbing_machine.write(tmp_path, columns))


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (r"\[grid\]", "[sample]\nn = 3\n[grid]", "remove .sample."),
        (r"\{.*\}", "1e-4", "nothing is open"),
        ("clearance =", "clearence =", "clearence"),
    ],
)
def test_what_cannot_be_identified_is_refused_in_a_line(tmp_path, old, new, text):
    measured, study = rubbing_machine.write(tmp_path, rubbing_machine.linear(False, 40, 0.05))
    study.write_text(re.sub(old, new, study.read_text()))
    with pytest.raises(InputError, match=text) as caught:
        read_problem(measured, study)
    assert "\n" not in str(caught.value)


def test_without_the_sampler_a_line_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "dynesty", None)
    files = rubbing_machine.write(tmp_path, rubbing_machine.linear(False, 40, 0.05))
    with pytest.raises(InputError, match=r"pip install 'rubhpc\[identify\]'"):
        rubhpc.identify(*files)


def test_the_command_writes_posterior_and_figures(rub, found, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sizes = (f"--{name}={number}" for name, number in SMALL.items())
    done = CliRunner().invoke(identify, [*map(str, rub), *sizes, "--workers", "2"])
    assert done.exit_code == 0, done.output
    assert "it is a rub" in done.output
    folder = tmp_path / "probe_identified"
    assert {path.name for path in folder.iterdir()} == {
        "cases",
        "posterior.nc",
        "corner.png",
        "predicted.png",
    }
    with xr.open_datatree(folder / "posterior.nc", engine="h5netcdf") as stored:
        assert stored["posterior"].equals(found[1].tree["posterior"])  # any number of processes
