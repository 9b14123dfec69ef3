"""`store.rub` draws what the figure commands draw."""

import inspect
import subprocess
import sys

import figure_stub
import matplotlib
import pytest
import synthetic_store

import rubhpc
from postproc.catalogue import figures
from rubhpc.errors import InputError

REST = {"clearance": "84 um", "friction": 0.3, "stator_youngs_modulus": "3 GPa"}
ONE = {"speed_ratio": 1.5, **REST}


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    path = tmp_path_factory.mktemp("stores") / "study.zarr"
    synthetic_store.write(path, synthetic_store.make())
    return rubhpc.open(path)


@pytest.fixture(autouse=True)
def unseen():
    with matplotlib.rc_context():
        matplotlib.use("agg")
        yield


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("cascade", REST),
        ("cascade", {"form": "intensity", **REST}),
        ("cascade", {"orders": True, "mark": {"stiff": "53.5 Hz"}, **REST}),
        ("map", {}),
        ("map", {"contours": 4}),
        ("map", {"value": "regime", "x": "friction"}),
        ("orbit", ONE),
        ("spectrum", ONE),
        ("spectrum", {"full": True, **ONE}),
        ("section", ONE),
        ("section", {"over": "speed_ratio", "y": "torsion", **REST}),
        ("bifurcation", {"signal": "torsion", "along": "speed_ratio", **REST}),
        ("sensitivity", {"draws": 10}),
    ],
)
def test_each_figure_is_drawn(store, name, args):
    ax = getattr(store.rub, name)(**args)
    assert ax.get_xlabel()
    ax.figure.canvas.draw()


def test_every_figure_is_a_method_with_its_signature_and_docstring(store):
    assert set(figures()) <= set(dir(store.rub))
    for name, figure in figures().items():
        method = getattr(store.rub, name)
        parameters = inspect.signature(method).parameters
        assert list(parameters) == [*figure.options, "ax", "choice"]
        assert {n: p.default for n, p in parameters.items() if n in figure.options} == {
            n: option.default for n, option in figure.options.items()
        }
        document = inspect.getdoc(method) or ""
        assert document.startswith(figure.description)
        for option in figure.options:
            assert f"\n{option}\n    " in document


def test_a_map_for_each_value_of_an_axis_goes_on_as_many_axes(store):
    maps = store.rub.map(facet="friction")
    assert [ax.get_title("left") for ax in maps] == [r"$\mu$ = 0.1", r"$\mu$ = 0.3"]
    again = store.rub.map(facet="friction", ax=maps)
    assert again == maps
    with pytest.raises(InputError, match="ax: 1 axes for a figure of 2; give as many"):
        store.rub.map(facet="friction", ax=maps[0])


@pytest.mark.parametrize(
    ("name", "args", "message"),
    [
        ("cascade", {"form": "water"}, 'form: "water" is not one of waterfall, intensity'),
        ("orbit", {"revolutions": 0, **ONE}, "revolutions: 0 is out of range; it must be at least 1"),
        ("orbit", {"speed_ratio": 1.4}, r"speed_ratio = 1\.4: not on the grid; choose one of"),
    ],
)
def test_a_wrong_value_is_refused(store, name, args, message):
    with pytest.raises(InputError, match=message):
        getattr(store.rub, name)(**args)


def test_waveforms_stand_above_one_another(store):
    axes = store.rub.waveform(["vertical", "contact_force"], revolutions=2, **ONE)
    assert len(axes) == 2
    assert "84 µm" in axes[0].figure.get_suptitle()
    (alone,) = store.rub.waveform("torsion", **ONE)
    assert alone.lines


def test_it_draws_on_axes_that_are_given(store):
    from matplotlib import pyplot

    _, ax = pyplot.subplots()
    assert store.rub.orbit(ax=ax, **ONE) is ax
    assert len(pyplot.get_fignums()) == 1


def test_pyplot_keeps_the_settings_of_a_notebook(store):
    from matplotlib import pyplot

    pyplot.ion()
    store.rub.map()
    assert matplotlib.is_interactive()
    assert matplotlib.rcParams["font.size"] != 8  # and its own style


def test_a_selection_can_be_gone_on_with(store):
    some = store.rub.select(friction=0.3, speed_ratio=slice(1.2, 1.6))
    assert dict(some.sizes)["speed_ratio"] == 2
    assert some.rub.map(x="speed_ratio", y="clearance").get_xlabel()


def test_what_run_up_returns_has_figures_though_no_store_was_opened():
    script = "import rubhpc, xarray; rubhpc.run_up; print(hasattr(xarray.Dataset, 'rub'))"
    found = subprocess.run([sys.executable, "-c", script], check=True, capture_output=True, text=True)
    assert found.stdout.strip() == "True"


def test_type_checkers_see_every_figure_as_it_is_declared():
    assert figure_stub.STUB.read_text() == figure_stub.text()
