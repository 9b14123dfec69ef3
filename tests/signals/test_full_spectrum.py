"""Full spectra of orbits whose forward and backward whirl is known."""

import math

import numpy as np
import pytest
import synthetic_store
import xarray as xr

from postproc.figures.cascade import cascade as cascade_figure
from postproc.figures.cascade import intensity, waterfall
from postproc.figures.cascade_lines import draw_frequencies, draw_orders
from postproc.figures.drawing import house_style, new_figure
from postproc.figures.spectrum import spectrum as spectrum_figure
from postproc.signals.cascade import below, cascade, hold_peaks
from postproc.signals.spectra import WHIRL, full_spectrum, spectrum_data
from postproc.store.select import select
from rubhpc.errors import InputError

N = 64  # samples a revolution


def orbit(components, revolutions=12, period=0, spin=2 * math.pi * 25.0):
    """A case whose orbit is a sum of circles: signed order -> (radius, phase)."""
    revolution = np.arange(N * revolutions) / N
    whirl = sum(a * np.exp(1j * (2 * math.pi * o * revolution + p)) for o, (a, p) in components.items())
    return xr.Dataset(
        {
            "vertical": ("sample", whirl.real, {"units": "m"}),
            "horizontal": ("sample", whirl.imag, {"units": "m"}),
            "spin_speed": ((), spin),
            "period": ((), period),
        },
        coords={"revolution": ("sample", revolution)},
    )


def line(spectrum, order):
    return float(spectrum.sel(order=order, method="nearest", tolerance=1e-9))


@pytest.mark.parametrize("tilt", np.linspace(0, math.pi, 5))
@pytest.mark.parametrize(("long", "short"), [(3.0, 1.0), (2.0, 2.0), (1.0, 0.0), (3.0, -1.0), (1.0, -1.0)])
def test_an_ellipse_is_a_forward_and_a_backward_circle(long, short, tilt):
    """Half axes a and b whirl as (a + b)/2 forward and (a - b)/2 backward, whatever the tilt."""
    revolution = np.arange(12 * N) / N
    angle = 2 * math.pi * revolution + 0.3
    whirl = (long * np.cos(angle) + 1j * short * np.sin(angle)) * np.exp(1j * tilt)
    signals = (
        xr.DataArray(s, dims="sample", coords={"revolution": ("sample", revolution)})
        for s in (whirl.real, whirl.imag)
    )
    spectrum = full_spectrum(*signals)
    assert line(spectrum, 1.0) == pytest.approx((long + short) / 2, abs=1e-12)
    assert line(spectrum, -1.0) == pytest.approx((long - short) / 2, abs=1e-12)
    assert float(spectrum.where(abs(spectrum["order"]) != 1.0).max()) < 1e-12


def test_every_circle_has_its_line():
    circles = {1.0: (4.0, 0.1), -1.0: (1.0, 2.0), 0.5: (0.7, 1.0), -1.5: (0.2, 0.0), 0.0: (5.0, 0.4)}
    spectrum = spectrum_data(orbit(circles), WHIRL)
    assert {o: line(spectrum, o) for o in circles} == pytest.approx({o: a for o, (a, _) in circles.items()})
    assert float(spectrum["frequency"].sel(order=-1.5)) == pytest.approx(-37.5)


def test_the_mean_square_radius_is_that_of_all_lines():
    rng = np.random.default_rng(4)
    case = orbit({1.0: (1.0, 0.0)})
    case["vertical"] += rng.normal(size=case.sizes["sample"])
    radius = float((case["vertical"] ** 2 + case["horizontal"] ** 2).mean())
    assert float((spectrum_data(case, WHIRL) ** 2).sum()) == pytest.approx(radius, rel=1e-12)


def test_whole_periods_of_a_third_order_are_taken():
    circles = {1.0: (1.0, 0.0), -1 / 3: (0.5, 0.3)}
    spectrum = spectrum_data(orbit(circles, revolutions=16, period=3), WHIRL)
    assert line(spectrum, -1 / 3) == pytest.approx(0.5, rel=1e-12)
    assert line(spectrum, 1.0) == pytest.approx(1.0, rel=1e-12)


@pytest.fixture
def speeds():
    """Circles of one forward and two backward whirls at three speeds; lazy, as from a store."""
    rates = (20.0, 25.0, 40.0)
    circles = {1.0: (1.0, 0.0), -1.0: (0.25, 0.5), -0.5: (0.5, 1.0)}
    cases = [orbit(circles, spin=2 * math.pi * rate) for rate in rates]
    store = xr.concat(cases, xr.DataArray([0.6, 0.8, 1.3], dims="speed_ratio", name="speed_ratio"))
    store["status"] = ("speed_ratio", np.ones(3, dtype=np.int8))
    return store.chunk(speed_ratio=1)


@pytest.mark.parametrize("limit", [30.0, 75.0, 500.0])
def test_a_cascade_of_full_spectra_has_both_sides(speeds, limit):
    spectra = cascade(speeds, WHIRL)
    assert spectra.chunks is not None
    cut = below(spectra, limit)
    assert float(cut["frequency"].min()) <= -min(limit, 20 * N / 2)
    assert cut.sel(order=-0.5).values == pytest.approx([0.5] * 3)
    held = hold_peaks(spectra, limit, 60).compute()
    assert held.shape == (3, 60)
    assert held["frequency"].values == pytest.approx(-held["frequency"].values[::-1])
    for row, rate in zip(held, (20.0, 25.0, 40.0), strict=True):
        for order, radius in ((-0.5, 0.5), (-1.0, 0.25), (1.0, 1.0)):
            if abs(order * rate) < limit * 0.99 and limit < 100:
                near = row.sel(frequency=order * rate, method="nearest")
                assert float(near) == pytest.approx(radius)


@pytest.mark.parametrize("figure", [spectrum_figure, cascade_figure])
def test_a_full_spectrum_of_a_signal_is_refused(speeds, figure):
    with pytest.raises(InputError, match="--full is of the orbit and conflicts with --signal vertical"):
        figure(speeds, "vertical", full=True)


@pytest.mark.parametrize("draw", [waterfall, intensity])
@pytest.mark.parametrize(("limit", "abscissa"), [(60.0, "frequency"), (3.0, "order")])
def test_cascade_figures_of_whirl_are_symmetric(speeds, draw, limit, abscissa):
    spectra = cascade(speeds, WHIRL)
    with house_style():
        _, (ax,) = new_figure()
        draw(spectra, ax, limit, abscissa)
        draw_orders(ax, spectra, abscissa=abscissa)
        draw_frequencies(ax, spectra, {"lateral": 31.56}, abscissa)
    assert ax.get_xlim() == (-limit, limit)
    assert {"backward", "forward"} <= {text.get_text() for text in ax.texts}
    dashed = [line.get_xdata() for line in ax.lines if line.get_linestyle() == "--" and line.get_lw() == 0.7]
    assert dashed[0] == pytest.approx(-dashed[1])


def test_a_store_without_waveforms_says_what_it_needs():
    store = synthetic_store.make(keep=("spectrum",))
    choice = {"clearance": 84e-6, "friction": 0.3, "stator_youngs_modulus": 3e9}
    with pytest.raises(InputError, match='run the study with "waveform"'):
        cascade(select(store, choice), WHIRL)
