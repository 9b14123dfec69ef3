"""The report in a browser: what a click, a key and a choice change, and how it looks narrow and wide."""

from __future__ import annotations

import re
import threading
from typing import TYPE_CHECKING

import pytest
from playwright.sync_api import expect

from postproc.report.server import Library, Server
from postproc.store.open import open_store

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from playwright.sync_api import Page

    Visit = Callable[..., Page]

PANELS = ("orbit", "section", "spectrum", "waveform")


def said(page: Page) -> str:
    return page.inner_text("#case-text").replace("\u00a0", " ")


def click_map(page: Page, across: float, up: float) -> None:
    """Click at parts of the map's inner frame."""
    page.locator("#map").scroll_into_view_if_needed()
    box = page.evaluate("""() => {
        const view = map.chart.view.frame.bbox, canvas = map.chart.view.el.getBoundingClientRect();
        return [canvas.x + view.left, canvas.y + view.top, view.width, view.height];
    }""")
    page.mouse.click(box[0] + across * box[2], box[1] + (1 - up) * box[3])


def pixels(page: Page, panel: str) -> bytes:
    return page.locator(f"#{panel} .plot").screenshot()


def test_a_click_shows_the_case_of_that_cell(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    before = {panel: pixels(page, panel) for panel in PANELS}
    click_map(page, 0.02, 0.98)
    expect(page.locator("#case-text")).to_contain_text("Speed ratio 0.75, clearance 100 µm")
    page.wait_for_timeout(300)
    assert "within the model's range" in said(page)
    # Sines, whatever the case: what differs is the clearance and the frequency.
    assert {panel for panel in PANELS if pixels(page, panel) != before[panel]} >= {"orbit", "spectrum"}
    click_map(page, 0.98, 0.02)
    expect(page.locator("#case-text")).to_contain_text("Speed ratio 1.7, clearance 70 µm")
    assert "out of the model's range: slip, Euler load" in said(page)


def test_the_pointer_is_reported_what_it_is_over(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    click_map(page, 0.97, 0.5)
    box = page.locator("#map").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 60)
    reported = re.compile(r"Speed ratio 1\.25, Clearance 100.µm\s+Regime: quasi-periodic")
    expect(page.locator("#tip")).to_contain_text(reported)
    page.mouse.move(2, 2)
    expect(page.locator("#tip")).to_be_hidden()


def test_keys_move_on_the_map(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    page.focus("#map")
    for key, place in (
        ("Home", "Speed ratio 0.75"),
        ("PageDown", "Speed ratio 0.75, clearance 70 µm"),
        ("ArrowRight", "Speed ratio 1, clearance 70 µm"),
        ("ArrowUp", "Speed ratio 1, clearance 84 µm"),
        ("ArrowLeft", "Speed ratio 0.75, clearance 84 µm"),
        ("ArrowLeft", "Speed ratio 0.75, clearance 84 µm"),
        ("End", "Speed ratio 1.7, clearance 84 µm"),
    ):
        page.keyboard.press(key)
        expect(page.locator("#case-text")).to_contain_text(place)
    outline = page.evaluate("getComputedStyle(document.getElementById('map')).outlineStyle")
    assert outline == "solid"


def test_every_axis_has_a_slider_that_says_its_value(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    sliders = page.get_by_role("slider")
    assert sliders.count() == 4
    modulus = page.get_by_role("slider", name="Stator modulus")
    modulus.focus()
    page.keyboard.press("Home")
    expect(page.locator("#case-text")).to_contain_text("stator modulus 3 GPa")
    assert modulus.get_attribute("aria-valuetext") == "3\u00a0GPa"


def test_cases_without_a_result_say_so(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    page.get_by_role("button", name=re.compile("^speed ratio 0.75, clearance 70 µm")).click()
    expect(page.locator("#case-text")).to_contain_text("diverged")
    expect(page.locator("#orbit .message")).to_have_text("This case has diverged")
    assert set(page.locator("#legend span").all_inner_texts()) >= {
        "missing",
        "failed",
        "diverged",
    }


def test_the_worst_case_is_one_click_away(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    page.get_by_role("button", name=re.compile("^1.2")).click()
    expect(page.locator("#map-title")).to_have_text("Contact force over Euler load, largest of 2 stators")
    expect(page.locator("#case-text")).to_contain_text("Speed ratio 1.7")


def test_the_page_opens_on_a_rub_and_lists_stators_worst_first(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["ring"])
    assert "peak contact force 0 N" not in said(page)
    assert "(largest of 3 stators)" in said(page)
    page.locator("#measures > summary").click()
    row = page.get_by_role("row", name=re.compile("^Peak contact force"))
    assert row.locator("summary").inner_text().endswith("stator 2")
    row.locator("summary").click()
    places = [text.split(":")[0] for text in row.locator("li").all_inner_texts()]
    assert places == ["stator 2", "stator 3", "stator 1"]
    page.get_by_label("Show", exact=True).select_option(label="Peak contact force")
    expect(page.locator("#map-title")).to_have_text("Peak contact force, largest of 3 stators")
    page.get_by_label("Of", exact=True).select_option(label="Stator 1")
    expect(page.locator("#map-title")).to_have_text("Peak contact force, stator 1")


def test_any_measure_over_any_axes(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    for name in page.get_by_label("Show", exact=True).locator("option").all_inner_texts():
        page.get_by_label("Show", exact=True).select_option(label=name)
        expect(page.locator("#map-title")).to_have_text(re.compile("^" + re.escape(name)))
    page.get_by_label("Across", exact=True).select_option(label="Stator modulus")
    page.get_by_label("Up", exact=True).select_option(label="Friction coefficient")
    page.get_by_label("Logarithmic colours").check()
    click_map(page, 0.98, 0.98)
    expect(page.locator("#case-text")).to_contain_text("friction coefficient 0.3, stator modulus 30 GPa")
    # Choosing the axis that stands on the other side swaps the two.
    page.get_by_label("Across", exact=True).select_option(label="Friction coefficient")
    assert page.get_by_label("Up", exact=True).evaluate("e => e.selectedOptions[0].text") == "Stator modulus"


def test_any_signal_in_its_panels(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    for name in ("Contact force", "Vertical displacement", "Stator axial displacement"):
        page.get_by_label("Signal of spectrum and waveform").select_option(label=name)
        expect(page.locator("#spectrum h3")).to_have_text(f"Spectrum: {name}")
        expect(page.locator("#waveform .plot")).to_have_attribute("aria-label", re.compile(name))
    page.get_by_label("Signal of spectrum and waveform").select_option(label="Vertical displacement")
    expect(page.locator("#spectrum .plot")).to_have_attribute(
        "aria-label", re.compile(r"strongest lines 1X 100\sµm, 2X 30\sµm, 1/2X 20\sµm")
    )
    page.get_by_label("Logarithmic amplitudes").check()
    page.get_by_label("Orders instead of Hz").check()
    assert page.evaluate("panels.spectrum.figure.below[0].axis_label").startswith("Order")


def test_names_of_lines_stay_within_their_panel(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    first, last = page.evaluate("""() => {
        const values = Array.from({ length: 1000 }, (_, i) => (i === 9 || i === 997 ? 1 : 0));
        panels.spectrum.name({ name: "torsion", values }, 0.01, 1, 10, 1);
        return panels.spectrum.names.data.x;
    }""")
    assert 0.3 < first < 1.0  # its line is at 0.1
    assert 9.0 < last < 9.8  # at 9.98


@pytest.mark.parametrize("name", ["whole", "line", "single", "scalars"])
def test_the_page_fits_its_window(visit: Visit, pages: dict[str, str], name: str) -> None:
    page = visit(pages[name], 390)
    for width in (390, 320, 700, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        page.wait_for_timeout(150)  # for the figures to follow
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        for panel in PANELS if name != "scalars" else ():
            box = page.locator(f"#{panel} canvas").first.bounding_box()
            assert box is not None
            assert box["width"] > 200
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= width


def test_one_axis_is_drawn_as_columns(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["line"])
    expect(page.locator("#map-title")).to_have_text(re.compile("Peak contact force"))
    click_map(page, 0.98, 0.1)
    expect(page.locator("#case-text")).to_contain_text("Speed ratio 1.7")
    page.focus("#map")
    page.keyboard.press("ArrowLeft")
    expect(page.locator("#case-text")).to_contain_text("Speed ratio 1.5")


def test_one_case_needs_no_map(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["single"])
    assert not page.is_visible("#map-card")
    expect(page.locator("#orbit .plot")).to_have_attribute("aria-label", re.compile("2 revolutions"))


def test_a_store_of_measures_has_maps_alone(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["scalars"])
    assert page.is_visible("#map canvas >> nth=0")
    expect(page.locator("#right")).to_contain_text("The store contains only measures")


@pytest.mark.parametrize(
    ("friction", "words"),
    [(0, "regime periodic, with a longer period than 16 revolutions,"), (1, "regime periodic once settled,")],
)
def test_a_periodic_motion_without_a_period_says_why(
    visit: Visit, pages: dict[str, str], friction: int, words: str
) -> None:
    page = visit(f"{pages['scalars']}#at=1.1.{friction}.0")
    expect(page.locator("#case-text")).to_contain_text(words)


def test_a_case_that_was_left_out_says_how_to_see_it(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["cut"])
    left_out = page.evaluate(
        "valuesOf('status').then((s) => s.findIndex((x, i) => x === 1 && !(i in embedded.records)))"
    )
    page.evaluate("(flat) => move(placeOf(flat))", left_out)
    expect(page.locator("#orbit .message")).to_contain_text("rubhpc view")


def test_a_link_leads_back_to_the_case(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    click_map(page, 0.02, 0.98)
    expect(page.locator("#case-text")).to_contain_text("Speed ratio 0.75, clearance 100 µm")
    page.wait_for_timeout(100)
    again = visit(page.url)
    assert "Speed ratio 0.75, clearance 100 µm" in said(again)
    assert "Speed" in said(visit(pages["whole"] + "#at=9.9.9.9&show=nothing&across=x"))


def test_the_colours_follow_the_scheme(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"], color_scheme="dark")
    ground = "getComputedStyle(document.body).backgroundColor"
    label = "panels.orbit.figure.below[0].axis_label_text_color"
    assert page.evaluate(f"[{ground}, {label}]") == ["rgb(20, 24, 27)", "#e6e9eb"]
    page.emulate_media(color_scheme="light")
    page.wait_for_function(f"{label} === '#1d2327'")
    assert page.evaluate(ground) == "rgb(251, 250, 248)"


def test_changes_are_reported_to_those_who_listen(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    assert page.locator("#case-text[role=status]").get_attribute("aria-live") == "polite"
    unnamed = page.evaluate("""() => [...document.querySelectorAll("button, input, select")]
        .filter((e) => !(e.labels?.length || e.textContent.trim())).length""")
    assert unnamed == 0
    assert page.get_by_role("application", name=re.compile("Regime")).count() == 1


def test_a_served_store_is_read_case_by_case(visit: Visit, stores: dict[str, Path]) -> None:
    asked = []
    with Server(Library(lambda: open_store(stores["whole"]))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        page = visit(server.url)
        page.on("request", lambda request: asked.append(request.url))
        click_map(page, 0.02, 0.98)
        expect(page.locator("#case-text")).to_contain_text("Speed ratio 0.75, clearance 100 µm")
        expect(page.locator("#orbit .plot")).to_have_attribute("aria-label", re.compile("2 revolutions"))
        server.shutdown()
    assert [url for url in asked if "/record/" in url]


def test_a_store_without_any_result_has_its_maps(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["empty"])
    expect(page.locator("#case-text")).to_contain_text("not computed yet")
    expect(page.locator("#legend")).to_have_text("missing")
    assert not page.evaluate("Boolean(map.bar)")


def test_what_is_offered_has_short_names(visit: Visit, pages: dict[str, str]) -> None:
    page = visit(pages["whole"])
    names = page.get_by_label("Show", exact=True).locator("option").all_inner_texts()
    assert {"Validity", "Regime", "Peak contact force"} <= set(names)
    assert len(names) == len(set(names))
