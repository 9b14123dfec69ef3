"""Names beside a scale of colours, and the legend below: they fit."""

from matplotlib.figure import Figure

from postproc.figures.small_multiples import color_names, legend_below


def test_few_names_are_all_written_and_many_are_thinned():
    few = [f"P{i}" for i in range(16)]
    assert color_names(few) == few
    many = ["none", *(f"P{i}" for i in range(1, 26))]
    shown = color_names(many)
    assert shown[:5] == many[:5]
    assert shown[-1] == "P25"
    assert len(shown) == len(many)
    assert len([name for name in shown if name]) <= 16


def test_a_long_label_is_folded():
    ax = Figure(figsize=(3.46, 2.5), layout="constrained").subplots()
    (line,) = ax.plot(
        [0, 1], label="out of range in all 4000 cases: slip (181), Euler load (226), foreshortening (4000)"
    )
    legend_below(ax, [line])
    (legend,) = ax.figure.legends
    assert max(map(len, legend.texts[0].get_text().splitlines())) <= 58
