"""The documents say what is so: commands, options, stored variables, links, and the Python that they show."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

import rubhpc
from rubhpc.cli import commands
from rubhpc.errors import InputError, RubError, StoppedEarly, StoreError
from rubhpc.running.ending import Crashed
from rubhpc.running.pool import RankLost
from rubhpc.study.points import Points
from rubhpc.study.study import Recording, read_study

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()
COMMANDS = (ROOT / "docs" / "reference" / "commands.md").read_text()
STORE = (ROOT / "docs" / "guide" / "store.md").read_text()
STUDIES = "Studies included"
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / "jobs").glob("*.md")])


def rows(text: str, heading: str) -> list[list[str]]:
    """Cells of the table below a heading, without its head."""
    section = text.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines[2:]]


def code(text: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def options_of(command: click.Command) -> set[str]:
    return {option for parameter in command.params for option in parameter.opts if option.startswith("--")}


def run_as_shown(text: str) -> dict[str, Any]:
    shown: dict[str, Any] = {}
    exec(compile(text, "document", "exec"), shown)
    return shown


@pytest.fixture(scope="module")
def quickstart(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a quickstart.zarr with four cases of the quick start, and short ones."""
    folder = tmp_path_factory.mktemp("quickstart")
    study = read_study(ROOT / "jobs" / "quickstart.toml", output=folder / "quickstart.zarr")
    wanted = {"speed_ratio": (1.7, 3.5), "clearance_ratio": (0.7, 0.85)}
    axes = tuple(replace(axis, values=wanted.get(axis.name, axis.values)) for axis in study.axes)
    rubhpc.run(replace(study, axes=axes, recording=Recording(transient=1, revolutions=4)), quiet=True)
    return folder


def commands_in(table: list[list[str]]) -> set[str]:
    names = [re.match(r"`(?:mpirun -n N )?rubhpc ([^\s`]+)", row[0])[1] for row in table]  # type: ignore[index]
    return {"run" if name == "STUDY.toml" else name for name in names}


def test_reference_lists_all_commands_and_the_readme_some() -> None:
    there = set(commands.list_commands(click.Context(commands)))
    assert commands_in(rows(COMMANDS, "All commands")) == there
    few = commands_in(rows(README, "Commands"))
    assert len(few) == 10
    assert few < there


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_commands_shown_can_be_given(path: Path) -> None:
    context = click.Context(commands)
    for line in "".join(code(path.read_text(), "sh")).splitlines():
        for name, rest in re.findall(r"\brubhpc ([a-z]+)(?= |$)(.*)", line.partition("#")[0]):
            command = commands.get_command(context, name)
            assert command is not None, line
            assert set(re.findall(r"--[a-z-]+", rest)) <= options_of(command), line


def test_readme_lists_the_exit_codes() -> None:
    codes = [int(number) for number, _ in rows(README, "Exit codes")]
    errors = (RubError, InputError, StoreError, StoppedEarly, Crashed, RankLost)
    assert codes == [0, *sorted(error.exit_code for error in errors)]


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path: Path) -> None:
    text = re.sub(r"```.*?```", "", path.read_text(), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        file, _, anchor = target.partition("#")
        if file.startswith("https:"):
            continue
        page = path.parent / file if file else path
        assert page.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w -]", "", h).lower().replace(" ", "-") for h in headings}, target


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_that_are_named_exist(path: Path) -> None:
    for name in re.findall(r"`((?:rubhpc|postproc|jobs|docs|tests)/[\w./-]*)`", path.read_text()):
        assert (ROOT / name).exists(), name


def test_simulation_of_the_readme_runs() -> None:
    shown = run_as_shown(code(README, "python")[0])
    assert shown["record"].period == 2
    assert shown["waveforms"].sizes["sample"] == 16 * 256


@pytest.mark.parametrize(
    "text", [code(README, "python")[1], code(STORE, "python")[0]], ids=["readme", "store"]
)
def test_store_is_opened_as_shown(text: str, quickstart: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(quickstart)
    shown = run_as_shown(text.replace('rubhpc.run("jobs/quickstart.toml")', ""))
    assert np.isfinite(next(shown[name] for name in ("worst", "torsion") if name in shown)).all()


@pytest.mark.long  # `make faults` has it
def test_slurm_job_draws_the_quick_start(quickstart: Path, tmp_path: Path) -> None:
    command = tmp_path / "rubhpc"
    command.write_text(f"""#!/bin/sh\nPYTHONPATH='{ROOT}' exec '{sys.executable}' -m rubhpc "$@"\n""")
    command.chmod(0o755)
    job = [
        "bash",
        ROOT / "jobs" / "slurm" / "figures.sh",
        quickstart / "quickstart.zarr",
        tmp_path / "figures",
    ]
    path = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(
        [*job, "--select", "clearance_ratio=0.7"], env=path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    drawn = {file.name for file in (tmp_path / "figures").iterdir()}
    assert drawn == {"contact_force.png", "contact_force.csv", "regime.png", "cascade.png"}


def test_study_of_the_readme_is_one(tmp_path: Path) -> None:
    (study,) = code(README, "toml")
    (tmp_path / "study.toml").write_text(study)
    (tmp_path / "my-rig.toml").write_text((ROOT / "rubhpc" / "rigs" / "mokhtar2017.toml").read_text())
    assert read_study(tmp_path / "study.toml").rig.name == "mokhtar2017"


def test_readme_shows_of_targets_that_exist() -> None:
    targets = re.findall(r"^([a-z]+):.*## ", (ROOT / "Makefile").read_text(), re.MULTILINE)
    reported = set(re.findall(r"(?:^|`)make ([a-z]+)", README + CONTRIBUTING, re.MULTILINE))
    assert reported <= set(targets)


def test_readme_shows_of_every_study_and_its_cases() -> None:
    reported = {re.search(r"\((.*)\)", row[0]).group(1): int(row[2]) for row in rows(README, STUDIES)}  # type: ignore[union-attr]
    axes = {path: read_study(path).axes for path in (ROOT / "jobs").glob("*.toml")}
    cases = {f"jobs/{path.name}": Points(axes[path]).n_case for path in axes}
    assert reported == cases


def test_figure_of_the_readme_is_small() -> None:
    assert (ROOT / "docs" / "figures" / "torsion_cascade.png").stat().st_size < 150_000


def test_first_study_shows_the_quick_start() -> None:
    (shown,) = code((ROOT / "docs" / "guide" / "first_study.md").read_text(), "toml")
    assert tomllib.loads(shown) == tomllib.loads((ROOT / "jobs" / "quickstart.toml").read_text())


def test_equations_have_their_own_numbers_and_names_without_backslashes() -> None:
    theory = "".join(path.read_text() for path in sorted((ROOT / "docs" / "theory").glob("*.md")))
    tags = re.findall(r"\\tag\{(\w+)\}", theory)
    assert len(tags) > 50
    assert len(tags) == len(set(tags))
    assert not re.findall(r"\\texttt\{[^}]*\\_", theory)  # MathJax shows the backslash


def test_numbers_of_documents_have_their_functions() -> None:
    pages = "".join(path.read_text() for path in (ROOT / "docs").rglob("*.md"))
    named = set(re.findall(r"`python tests/bench/documented\.py (\w+)`", pages))
    script = (ROOT / "tests" / "bench" / "documented.py").read_text()
    assert named == set(re.findall(r"^def (\w+)\(\) -> None:", script, re.MULTILINE))
