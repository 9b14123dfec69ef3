"""The catalogue: a figure is one file, whose signature and docstring give command, method and help."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import synthetic_store
from click.testing import CliRunner

from postproc.catalogue import figures
from rubhpc.cli import commands

ROOT = Path(__file__).parents[2]
TOY = '''"""A figure of one bar."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.figures.drawing import Drawing

if TYPE_CHECKING:
    import xarray as xr

    from postproc.figures.options import Annotated, Axis, Bounds, Hertz, Literal, Mapping, Metavar, Sequence


def toy(
    cases: xr.Dataset,
    measure: str = "peak_torsion",
    *,
    side: Literal["left", "right"] = "left",
    bars: Annotated[int, Bounds(least=1, most=9), Metavar("N")] = 3,
    over: Sequence[Axis] = (),
    mark: Mapping[str, Hertz] | None = None,
    log: bool = False,
) -> Drawing:
    """Bars of the largest measure.

    As many bars as are asked for.

    Parameters
    ----------
    cases
        All of them.
    measure
        Which measure.
    side
        Where the bars begin.
    bars
        How many bars there
        are.
    over
        One axis, or several.
    mark
        One more bar.
    log
        On a logarithmic scale.
    """
    largest = float(cases[measure].max())
    lines = (f"{measure} {largest:g}, {bars} bars on the {side}, {dict(mark or {})}",)
    shown = cases[[measure]].max()
    return Drawing(shown=shown, draw=lambda axes: axes[0].bar(np.arange(bars), largest), lines=lines)
'''


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A folder with one more figure, where the others are looked for too."""
    import postproc.figures

    folder = tmp_path / "more"
    folder.mkdir()
    (folder / "toy.py").write_text(TOY)
    monkeypatch.setattr(postproc.figures, "__path__", [*postproc.figures.__path__, str(folder)])
    monkeypatch.chdir(tmp_path)
    return folder


def invoke(*args: str) -> str:
    return CliRunner().invoke(commands, list(args), catch_exceptions=False).output


@pytest.mark.usefixtures("toy")
def test_a_file_with_a_function_of_its_name_is_a_command():
    assert "\n  toy          Bars of the largest measure." in invoke("--help")
    shown = " ".join(invoke("toy", "--help").split())
    for text in (
        "Bars of the largest measure. As many bars as are asked for.",
        "--measure TEXT Which measure. [default: peak_torsion]",
        "--side [left|right] Where the bars begin. [default: left]",
        "--bars N How many bars there are. [default: 3; 1<=x<=9]",
        "--over AXIS One axis, or several.",
        "--mark NAME=HZ One more bar.",
        "--log On a logarithmic scale.",
    ):
        assert text in shown
    assert "toy.py" not in {Path(getattr(m, "__file__", None) or "").name for m in sys.modules.values()}


@pytest.mark.usefixtures("toy")
def test_its_lines_are_printed_and_its_figure_is_saved(tmp_path):
    synthetic_store.write(tmp_path / "study.zarr", synthetic_store.make())
    printed = invoke("toy", "study.zarr", "--bars", "2", "--side", "right", "--mark", "a=3 Hz").splitlines()
    assert printed[0].endswith(", 2 bars on the right, {'a': '3 Hz'}")
    assert printed[1] == "study_toy.png"
    assert Path("study_toy.png").exists()


def test_it_is_a_method_of_a_store(toy):
    synthetic_store.write(Path("study.zarr"), synthetic_store.make())
    script = (
        f"import matplotlib, postproc.figures; postproc.figures.__path__.append({str(toy)!r})\n"
        "matplotlib.use('agg')\n"
        "import rubhpc; cases = rubhpc.open('study.zarr')\n"
        "assert len(cases.rub.toy('peak_torsion', bars=4, friction=0.3).patches) == 4\n"
        "assert cases.rub.toy.__doc__.startswith('Bars of the largest measure.')\n"
        "assert 'toy' in dir(cases.rub)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", script], env=environment, check=True, timeout=120)


def test_every_option_has_its_help_and_every_figure_its_summary():
    for figure in figures().values():
        assert figure.summary.endswith(".")
        assert len(figure.summary) < 70
        assert all(option.help for option in figure.options.values()), figure.name
