"""`store.rub` draws what the figure commands draw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib
import pytest
import synthetic_store

import rubhpc
from rubhpc.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

REST = {"clearance": "84 um", "friction": 0.3, "stator_youngs_modulus": "3 GPa"}
BIFURCATION = "Torsion,\nonce a revolution (nrad)"
ONE = {"speed_ratio": 1.5, **REST}


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    path = tmp_path_factory.mktemp("stores") / "study.zarr"
    synthetic_store.write(path, synthetic_store.make())
    return rubhpc.open(path)


@pytest.fixture(autouse=True)
def unseen() -> Iterator[None]:
    with matplotlib.rc_context():
        matplotlib.use("agg")
        yield
        from matplotlib import pyplot

        pyplot.close("all")


@pytest.mark.parametrize(
    ("name", "args", "labels"),
    [
        ("cascade", REST, ("Frequency (Hz)", "Speed ratio $r$")),
        ("cascade", {"form": "intensity", **REST}, ("Frequency (Hz)", "Speed ratio $r$")),
        ("map", {}, ("Speed ratio $r$", "Clearance (µm)")),
        ("map", {"value": "regime", "x": "friction"}, ("Friction coefficient", "Speed ratio $r$")),
        ("orbit", ONE, ("Horizontal displacement (µm)", "Vertical displacement (µm)")),
        ("spectrum", ONE, ("Frequency (Hz)", "Torsion amplitude (µrad)")),
        ("spectrum", {"signal": "whirl", **ONE}, ("Frequency (Hz)", "Whirl amplitude (µm)")),
        ("section", ONE, ("Horizontal displacement (nm)", "Vertical displacement (µm)")),
        ("section", {"over": "speed_ratio", "y": "torsion", **REST}, ("Speed ratio $r$", BIFURCATION)),
    ],
)
def test_each_figure_is_drawn(store: xr.Dataset, name: str, args: dict, labels: tuple[str, str]) -> None:
    ax = getattr(store.rub, name)(**args)
    assert (ax.get_xlabel(), ax.get_ylabel()) == labels
    ax.figure.canvas.draw()


def test_waveforms_stand_above_one_another(store: xr.Dataset) -> None:
    axes = store.rub.waveform(["vertical", "contact_force"], revolutions=2, **ONE)
    assert len(axes) == 2
    assert "84 µm" in axes[0].figure.get_suptitle()
    (alone,) = store.rub.waveform("torsion", **ONE)
    assert alone.lines


def test_it_draws_on_axes_that_are_given(store: xr.Dataset) -> None:
    from matplotlib import pyplot

    _, ax = pyplot.subplots()
    assert store.rub.orbit(ax=ax, **ONE) is ax
    assert len(pyplot.get_fignums()) == 1


def test_pyplot_keeps_the_settings_of_a_notebook(store: xr.Dataset) -> None:
    from matplotlib import pyplot

    pyplot.ion()
    store.rub.map()
    assert matplotlib.is_interactive()
    assert matplotlib.rcParams["font.size"] != 8  # and its own style


def test_a_selection_can_be_gone_on_with(store: xr.Dataset) -> None:
    some = store.rub.select(friction=0.3, speed_ratio=slice(1.2, 1.6))
    assert dict(some.sizes)["speed_ratio"] == 2
    assert some.rub.map(x="speed_ratio", y="clearance").get_xlabel()


def test_a_wrong_value_names_what_is_near(store: xr.Dataset) -> None:
    with pytest.raises(InputError, match=r"speed_ratio = 1\.4: not on the grid; there is"):
        store.rub.orbit(speed_ratio=1.4)
