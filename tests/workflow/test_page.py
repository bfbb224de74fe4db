"""The page of a real sweep in a real browser: it opens from a file, draws, and answers to its controls."""

from __future__ import annotations

import io
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, expect, sync_playwright

from limo.store.files import read_json, write_json

from .conftest import copied

CHROMIUM = shutil.which("chromium")
PATIENCE = 180_000  # ms: without a graphics card everything is drawn by the processor
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
NASTY = '</script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2">'

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: install the system's package chromium")


@pytest.fixture(scope="module")
def results(solved, tmp_path_factory) -> Path:
    """The results of the tiny sweep with a study more that measures its cases, of which one is made to have failed.

    A third one has the surface of a device that beats.
    """
    project = copied(solved.folder, tmp_path_factory.mktemp("page") / "copy")
    project.study("measured", outputs=["volumes", "stress", "strain", "fatigue"], description=NASTY)
    axes = {"n_pouches": [4], "ventricular_pressure": [0.5, 4, 12, 25]}
    load = {"actuation_pressure_max": 80, "actuation": [0, "max", 0], "frames": [0, 40, "max"]}
    mesh = {"level": "tiny", "element": "SHELL8R", "symmetry": "quarter"}
    project.study("beating", axes=axes, engine="newton", mesh=mesh, figures=[], outputs=["volumes"], **load)
    failed = next(project.folder.glob("results/cases/*np4*/status.json"))
    write_json(failed, read_json(failed) | {"status": "diverged", "reason": NASTY})
    done = project.snakemake("tiny", "measured", "beating", "--forcerun", "gather_study")
    assert done.returncode == 0, done.stdout + done.stderr
    planned = project.planned("page")
    assert planned == {"page": 1, "total": 1}, "nothing is solved, gathered or drawn for it"
    done = project.snakemake("page")
    assert done.returncode == 0, done.stdout + done.stderr
    return project.folder / "results"


@pytest.fixture(scope="module")
def complaints() -> list[str]:
    """What the browser complains about, and what it asks a network for."""
    return []


@pytest.fixture(scope="module")
def page(results, complaints):
    """The open page."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE, timeout=PATIENCE)
        opened = browser.new_page(viewport={"width": 1280, "height": 900})
        opened.set_default_timeout(PATIENCE)
        opened.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        opened.on("pageerror", lambda error: complaints.append(str(error)))
        opened.on("request", lambda r: None if r.url.startswith(("file:", "data:", "blob:")) else complaints.append(r.url))
        opened.goto((results / "index.html").as_uri())
        opened.wait_for_selector("body[data-ready]")
        yield opened
        browser.close()


def picture(page: Page) -> np.ndarray:
    """The device as it is drawn (h, w, 3), without the scale beside it, once the picture has come to rest."""
    until, before = time.monotonic() + PATIENCE / 1e3, None
    page.mouse.move(2, 2)  # no buttons and labels over it
    while time.monotonic() < until:
        png = page.locator("#device-plot").screenshot()
        image = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
        image = image[:, : 4 * image.shape[1] // 5]
        if before is not None and (image == before).all():
            return image
        before = image
        page.wait_for_timeout(700)
    raise AssertionError("the picture does not come to rest")


def changed(a: np.ndarray, b: np.ndarray) -> float:
    """Share of the picture that differs visibly."""
    return float((np.abs(a - b).max(axis=2) > 24).mean())


def chosen(page: Page, select: str) -> list[str]:
    return page.locator(f"{select} option:not([disabled])").evaluate_all("options => options.map(o => o.value)")


def test_the_device_is_drawn_in_colours_and_moves_with_the_slider(page):
    page.select_option("#device-study", "tiny")
    first = picture(page)
    coloured = (first.max(axis=2) - first.min(axis=2) > 40).mean()
    assert coloured > 0.05, "a coloured device on white"
    assert (first.min(axis=2) > 240).mean() > 0.2
    said = page.locator("#device-pressure").inner_text()
    page.locator("#device-stop").focus()
    page.keyboard.press("Home")
    expect(page.locator("#device-pressure")).to_have_text("0 kPa")
    second = picture(page)
    assert said != "0 kPa"
    assert page.locator("#device-stop").get_attribute("aria-valuetext") == "0 kPa"
    assert changed(first, second) > 0.01
    page.keyboard.press("End")
    assert changed(first, picture(page)) < 0.002, "back where it was"


def test_a_beat_moves_the_device_beside_its_loop(page):
    """Over a beat V_v and the picture change; at its end the device is nearly where it began."""
    page.select_option("#device-study", "tiny")
    assert page.locator("#device-beats").is_hidden()
    page.select_option("#device-study", "beating")
    assert page.locator("#beat-plot").is_hidden()
    assert "healthy" in chosen(page, "#device-beat")
    page.select_option("#device-beat", "healthy")
    page.locator("#device-stop").focus()
    pictures = []
    for keys, seconds in ((["Home"], r"0\.00"), (["PageUp"] * 3, r"0\.[^0].|0\.0[^0]"), (["End"], r"1\.00")):
        for key in keys:
            page.keyboard.press(key)
        expect(page.locator("#device-pressure")).to_have_text(re.compile(rf"^({seconds}) s: P_a"))
        pictures.append(picture(page))
    assert changed(pictures[0], pictures[1]) > 0.01
    assert changed(pictures[0], pictures[2]) < 0.5 * changed(pictures[0], pictures[1])
    assert "ml a beat" in page.locator("#device-note").inner_text()
    assert page.locator("#beat-plot .main-svg").first.is_visible()
    page.select_option("#device-beat", "")
    assert page.locator("#beat-plot").is_hidden()
    expect(page.locator("#device-pressure")).to_have_text(re.compile(r"^[\d.]+ kPa"))  # once the picture is drawn


def test_dragging_turns_the_device_and_the_view_stays(page):
    first = picture(page)
    box = page.locator("#device-plot").bounding_box()
    x, y = box["x"] + 0.4 * box["width"], box["y"] + 0.5 * box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 9):
        page.mouse.move(x + 20 * step, y + 4 * step)
        page.wait_for_timeout(150)
    page.mouse.up()
    turned = picture(page)
    assert changed(first, turned) > 0.03
    page.mouse.move(x, y)
    page.mouse.wheel(0, -400)
    assert changed(turned, picture(page)) > 0.01, "zoomed"
    page.get_by_role("button", name="front").click()
    front = picture(page)
    page.select_option("#device-part", "front")
    page.select_option("#device-part", "whole")
    assert changed(front, picture(page)) < 0.002


def test_quantities_that_were_measured_colour_the_device(page):
    page.select_option("#device-study", "tiny")
    assert chosen(page, "#device-quantity")[0] == "displacement"
    page.select_option("#device-study", "measured")
    assert set(chosen(page, "#device-quantity")) >= {"displacement", "von_mises", "strain_outer", "cycles"}
    seen = []
    for quantity in ("displacement", "von_mises", "strain_outer", "cycles"):
        page.select_option("#device-quantity", quantity)
        seen.append(picture(page))
    for k, image in enumerate(seen):
        assert all(changed(image, other) > 0.02 for other in seen[:k])
    page.select_option("#device-quantity", "von_mises")
    page.get_by_label("flat pattern").check()
    flat = picture(page)
    assert changed(flat, seen[1]) > 0.02
    page.get_by_label("epicardium").uncheck()
    assert changed(flat, picture(page)) > 0.005, "the endocardium below it, of the two pouches"
    page.get_by_label("epicardium").check()
    page.get_by_label("deformed").check()


def test_curves_are_drawn_over_any_axis(page):
    page.select_option("#curve-study", "tiny")

    def lines() -> list[int]:
        return page.evaluate("document.getElementById('curve-plot').data.map(line => line.x.length)")

    def label(axis: str) -> str:
        return page.locator(f"#curve-plot .{axis}title").text_content()

    assert "P" in label("x")
    assert "[kPa]" in label("x")
    assert "[ml]" in label("y")
    assert len(lines()) == 2
    page.get_by_label("4", exact=True).uncheck()
    assert len(lines()) == 1
    page.select_option("#curve-axis", "n_pouches")
    assert "number of pouches" in label("x")
    assert lines() == [2]
    page.select_option("#curve-study", "measured")
    page.select_option("#curve-quantity", "von_mises_peak")
    assert "[MPa]" in label("y")
    assert lines() == [2]
    page.select_option("#curve-axis", "frame")
    assert lines() == [3, 3]
    assert page.locator("#curve-plot .scatterlayer path.js-line").count() == 2


def test_texts_are_texts_and_failed_cases_are_listed(page):
    assert page.locator("#studies").get_by_text(NASTY, exact=True).count() == 1
    row = page.locator("#problems tr", has_text="diverged").first
    assert NASTY in row.inner_text()
    assert page.evaluate("window.hacked") is None


@pytest.mark.parametrize("width", [1280, 800])
def test_nothing_is_wider_than_the_window(page, width):
    page.set_viewport_size({"width": width, "height": 900})
    page.wait_for_timeout(500)
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_files_beside_the_page_are_there(page, results):
    links = page.locator("main a").evaluate_all("links => links.map(a => a.getAttribute('href'))")
    files = [link for link in links if not link.startswith("#")]
    assert {link.rsplit("/", 1)[-1] for link in files} >= {"study.csv", "study.nc", "frames.nc", "pressure_volume.pdf"}
    assert all((results / link).exists() for link in files)


def test_the_browser_has_no_complaint(page, complaints):
    assert complaints == []
