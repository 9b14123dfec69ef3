"""The paper's figures, drawn from the synthetic stores: their panels, their curves, and what they mark."""

import pytest
from synthetic_paper import SAMPLES

from postproc.figures.drawing import house_style
from postproc.mokhtar2017.figures.pages import FIGURES, draw_figures
from postproc.mokhtar2017.figures.panels import between_contacts
from rubhpc.errors import InputError

# figure: panels, as the paper has them
PANELS = {
    3: 3, 4: 4, 5: 3, 6: 8, 7: 3, 8: 3, 9: 3, 10: 2, 11: 2,
    12: 2, 13: 6, 14: 4, 15: 6, 16: 3, 17: 4, 18: 4, 19: 2, 20: 1,
}  # fmt: skip


def drawn(number, stores):
    with house_style():
        return FIGURES[number].of(stores)


@pytest.mark.parametrize("number", FIGURES)
def test_figures_have_the_panels_of_the_paper(number, sound):
    panels = [ax for ax in drawn(number, sound).axes if ax.get_label() != "<colorbar>"]
    assert len(panels) == PANELS[number]
    letters = [ax.get_title(loc="left")[:3] for ax in panels]
    assert letters == [f"({chr(ord('a') + i)})" for i in range(len(panels))] or number == 20
    assert all(ax.get_xlabel() and ax.get_ylabel() for ax in panels)
    assert all(ax.lines or ax.collections for ax in panels)


def test_cases_over_one_another_are_distinguished(sound):
    torsion = drawn(10, sound).axes[0]
    assert [text.get_text() for text in torsion.get_legend().get_texts()] == [
        f"$\\mu$ = {friction}" for friction in (0.1, 0.3, 0.5)
    ]
    assert len({line.get_linestyle() for line in torsion.lines[:3]}) >= 2
    assert len({line.get_color() for line in torsion.lines[:3]}) == 3
    peaks = [line.get_ydata().max() for line in torsion.lines[:3]]
    assert peaks == pytest.approx([peaks[0], 3 * peaks[0], 5 * peaks[0]], rel=1e-3)


@pytest.mark.parametrize("study", ["subcritical", "clearance", "friction"])
def test_panels_over_time_cut_no_contact(study, sound):
    force = sound[study]["contact_force"].isel(stator=0)
    start = between_contacts(force)
    edge = force.values.reshape(-1, SAMPLES)[:, start]
    assert (edge == 0).all()
    turned = force.roll(sample=SAMPLES // 3)  # wherever contact lies
    assert (turned.values.reshape(-1, SAMPLES)[:, between_contacts(turned)] == 0).all()


def test_the_cascade_marks_what_it_found(sound):
    (ax,) = drawn(20, sound).axes
    texts = {text.get_text(): text.xy for text in ax.texts}
    assert set("abcfghijk") <= texts.keys()
    rate = 31.5596
    for letter, order, ratio in (("a", 1, 1.7), ("b", 1 / 2, 3.5), ("c", 1 / 3, 5.3), ("i", 4 / 3, 5.3)):
        frequency, height = texts[letter]
        assert frequency == pytest.approx(order * ratio * rate, rel=1e-4)
        assert ratio <= height < ratio + 1
    assert "torsional 128 Hz" in texts
    assert "pseudo-critical 53.65 Hz" in texts


def test_a_folder_that_cannot_be_made_is_reported(sound, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="choose another --draw"):
        list(draw_figures([9], sound, tmp_path / "file" / "figures"))
