from __future__ import annotations

import re
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from running import environment, write_study

from postproc.catalogue import figures
from rubhpc import cli
from rubhpc.cli import COMMANDS, main

if TYPE_CHECKING:
    from pathlib import Path


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Run the command line in this process; its exit code, output and errors."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


@pytest.mark.parametrize("name", [*COMMANDS, *figures()])
def test_every_command_has_help(name, capsys):
    code, out, err = call(capsys, name, "--help")
    assert (code, err) == (0, "")
    assert "Usage: rubhpc" in out


def test_help_names_every_command(capsys):
    code, out, _ = call(capsys, "--help")
    assert code == 0
    for name in [*COMMANDS, *figures()]:
        assert f"\n  {name} " in out


def loaded_by(code: str) -> set[str]:
    reported = subprocess.run(
        [sys.executable, "-c", f"{code}\nimport sys; print(*sys.modules)"],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    return set(reported.stdout.split())


HEAVY = {"numpy", "numba", "mpi4py", "zarr", "xarray", "dask", "scipy", "matplotlib", "pint", "rich"}


def test_help_and_import_load_nothing_heavy():
    assert not HEAVY & loaded_by("import rubhpc")
    assert not HEAVY & loaded_by(
        "from rubhpc.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass"
    )


def test_a_run_loads_nothing_that_reading_needs():
    loaded = loaded_by("import rubhpc.running.driver, rubhpc.running.worker, rubhpc.simulate")
    assert "numba" in loaded
    assert not {"xarray", "pandas", "dask", "matplotlib", "pint", "rich", "scipy.optimize"} & loaded


def test_status_loads_neither_mpi_nor_numba_nor_zarr(tmp_path):
    call_status = f"main(['status', {str(tmp_path / 'x')!r}])"
    code = f"from rubhpc.cli import main\ntry: {call_status}\nexcept SystemExit: pass"
    assert not (HEAVY - {"numpy"}) & loaded_by(code)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ([], 2, "nothing to do; give a STUDY.toml or a command, see rubhpc --help"),
        (["nowhere.toml"], 2, "nowhere.toml: no such file"),
        (["plan", "nowhere.toml"], 2, "nowhere.toml: no such file"),
        (["stauts", "x"], 2, "stauts: no such command or study; did you mean status?"),
        (["nosuch", "--help"], 2, "nosuch: no such command or study; see rubhpc --help"),
        (["--frobnicate", "x.toml"], 2, "--frobnicate"),
        (["status", "--frobnicate", "x"], 2, "--frobnicate"),
        (["status"], 2, "STORE"),
        (["status", "nowhere.zarr"], 3, "nowhere.zarr: no such store"),
        (["status", "."], 3, "is not a rubhpc store"),
        (["orbit", "nowhere.zarr"], 3, "nowhere.zarr: no such store"),
        (["verify", "nowhere.zarr"], 3, "nowhere.zarr: no such store"),
        (["x.toml", "--time-limit", "3 parsecs"], 2, "--time-limit"),
        (["x.toml", "--max-failures", "-1"], 2, "--max-failures"),
    ],
)
def test_errors_are_one_line_with_their_code(arguments, code, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    got, out, err = call(capsys, *arguments)
    assert (got, out) == (code, "")
    assert err.startswith("rubhpc: ")
    assert message in err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_asks_for_the_same_command(capsys, monkeypatch):
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli.commands, "invoke", interrupt)
    code, _, err = call(capsys, "status", "x")
    assert code == 75
    assert err.strip() == "rubhpc: interrupted; run the same command again"  # click ends the line of the ^C


@pytest.mark.parametrize(
    ("command", "code", "advice"), [("status", 70, ""), ("map", 3, ", unless rubhpc verify finds damage")]
)
def test_an_error_of_the_programs_own_is_one_line_too(capsys, monkeypatch, command, code, advice):
    """A store that cannot be evaluated is one that cannot be used."""

    def slip(*_: object) -> None:
        raise LookupError("a\nslip")

    monkeypatch.setattr(cli.commands, "invoke", slip)
    found, _, err = call(capsys, command, "x")
    assert found == code
    assert err.startswith("rubhpc: rank 0: LookupError: a slip; the traceback is in ")
    assert err.endswith(f"; please report it{advice}\n")
    assert err.count("\n") == 1


def test_plan_run_status_verify(capsys, tmp_path):
    study, store = write_study(tmp_path), tmp_path / "tiny.zarr"
    code, out, err = call(capsys, "plan", study)
    assert (code, err) == (0, "")
    assert "12 = 2 speed_ratio x 2 clearance_ratio x 3 friction" in out
    assert "12 missing" in out
    assert "core-hours" in out
    assert [path.name for path in tmp_path.iterdir()] == ["tiny.toml"]  # it writes nothing

    code, out, err = call(capsys, study)
    assert (code, err) == (0, "")
    assert out.splitlines()[-2].startswith(f"{store}: 12 done; 12 computed in ")
    shown = "12 undecided; 0 not settled; 12 out of the model's range: foreshortening (12), "
    assert out.splitlines()[-1].startswith(shown)
    assert shown in call(capsys, "status", store)[1]

    code, out, err = call(capsys, "run", study, "--quiet")
    assert (code, out, err) == (0, "", "")

    code, out, _ = call(capsys, "plan", study)
    assert "12 done, 0 failed, 0 diverged, 0 missing" in out
    assert "0 core-hours" in out

    code, out, err = call(capsys, "status", store)
    assert (code, err) == (0, "")
    assert out.splitlines()[:-1] == ["tiny", "12 cases: 12 done, 0 failed, 0 diverged, 0 missing"]

    code, out, err = call(capsys, "verify", store)
    assert (code, out, err) == (0, "12 cases checked, no damage\n", "")


def test_plan_predicts_what_the_store_holds(capsys, tmp_path):
    """Bytes are before compression, so the finished store is no larger; files are counted to a tenth."""
    study, store = write_study(tmp_path), tmp_path / "tiny.zarr"
    _, out, _ = call(capsys, "plan", study)
    n_file = int(out.split(" files")[0].split()[-1])
    call(capsys, study, "--quiet")
    files = [path for path in store.rglob("*") if path.is_file()]
    assert n_file == pytest.approx(len(files), rel=0.1)


def test_another_study_is_refused_by_run_and_plan(capsys, tmp_path):
    call(capsys, write_study(tmp_path), "--quiet")
    other = write_study(tmp_path, "other.toml", transient=3)
    for arguments in ([other], ["plan", other]):
        code, _, err = call(capsys, *arguments)
        assert code == 3
        assert "record.transient was 1, is 3" in err
        assert err.count("\n") == 1


def test_the_python_face(tmp_path: Path):
    import rubhpc

    summary = rubhpc.run(write_study(tmp_path), quiet=True)
    ds = rubhpc.open(summary.store)
    assert ds.vertical.chunks is not None
    assert (ds.status == 1).all()
    import rubhpc.simulate  # the module does not hide the function

    case = ds.isel(speed_ratio=1, clearance_ratio=0, friction=2)
    alone = rubhpc.simulate(
        "mokhtar2017",
        speed=float(case.spin_speed),
        clearance=float(case.clearance),
        friction=0.5,
        model="mokhtar2017",
        transient=1,
        revolutions=2,
        samples_per_revolution=32,
    )
    assert (case.vertical.values == alone.vertical.astype("f4")).all()
    assert {name for name in rubhpc.__all__ if getattr(rubhpc, name) is None} == set()
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        rubhpc.nothing  # noqa: B018


def test_plan_names_the_start_of_a_process(tmp_path, capsys):
    code, out, _ = call(capsys, "plan", write_study(tmp_path))
    assert code == 0
    found = re.search(r"core-hours \(.* on one core\), including (\d+\.\d) s to start a process", out)
    assert found is not None
    assert float(found[1]) > 0.0


def test_plan_times_a_transient_that_ends_by_itself(tmp_path, capsys):
    study = write_study(tmp_path, transient='"auto"\ntransient_limit = 9\ntransient_tolerance = 1e-3')
    code, out, err = call(capsys, "plan", study)
    assert (code, err) == (0, "")
    assert "core-hours (" in out
    assert "failed      " not in out


def test_plan_shows_why_its_cases_failed(tmp_path, monkeypatch, capsys):
    from rubhpc.running import sampled_cases

    def burst(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by\nzero")

    monkeypatch.setattr(sampled_cases, "record_of", burst)
    code, out, err = call(capsys, "plan", write_study(tmp_path))
    assert (code, err) == (0, "")
    assert "core-hours unknown: the timed cases failed" in out
    assert "failed      a timed case: speed_ratio=0.9, clearance_ratio=0.7, friction=0.1: " in out
    assert "ZeroDivisionError: by zero" in out
