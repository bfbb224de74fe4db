"""PNGs of figures: none larger than the limit, in as many colours and dots as fit into it."""

from io import BytesIO

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from limo.figures import style


@pytest.fixture
def saved(tmp_path):
    """``saved(limit)``: the PNG of a shaded picture that fills 1.5 by 1 inches, when there may be as many bytes."""

    def save(limit: int) -> bytes:
        y, x = np.mgrid[0:1:190j, 0:1:285j]
        figure = style.plt.figure(figsize=(1.5, 1))
        axis = figure.add_axes((0.025, 0.025, 0.95, 0.95))
        axis.set_axis_off()
        axis.imshow(style.plt.get_cmap("viridis")(x)[..., :3] * (0.5 + 0.5 * np.sin(25 * x * y) ** 2)[..., None], aspect="auto")
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(style, "LARGEST_PNG", limit)
            style.save(figure, tmp_path / "picture.png")
        style.close(figure)
        return (tmp_path / "picture.png").read_bytes()

    return save


def test_the_ratio_is_drawn_from_the_ventricular_pressure_on():
    curves = {n: ("actuation_pressure", [9.0, 5.0, 1.0, 1.2]) for n in ("io_ratio", "stroke_volume")}
    case = xr.Dataset(curves, coords={"actuation_pressure": [0.0, 2.0, 4.0, 6.0], "ventricular_pressure": 3.8})
    np.testing.assert_array_equal(style.drawn(case, "io_ratio"), [np.nan, np.nan, 1.0, 1.2])
    np.testing.assert_array_equal(style.drawn(case, "stroke_volume"), case.stroke_volume)


def pixels(png: bytes) -> np.ndarray:
    """(h, w, 3) of a PNG."""
    with Image.open(BytesIO(png)) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def test_a_png_loses_no_more_colour_than_it_must(saved):
    """Each limit is just too low for what came before: all colours, 64 levels, 256 colours."""
    exact = saved(10**6)
    rounded = saved(len(exact) - 1)
    palette = saved(len(rounded) - 1)
    assert len(exact) > len(rounded) > len(palette)
    assert pixels(exact).shape == pixels(rounded).shape == pixels(palette).shape == (200, 300, 3)
    assert len(np.unique(pixels(palette).reshape(-1, 3), axis=0)) <= 256
    for png, moved in ((rounded, 2), (palette, 16)):
        assert 0 < np.abs(pixels(png) - pixels(exact)).max() <= moved
    for png in (exact, rounded):
        assert (pixels(png)[0] == 255).all(), "the paper is white"


def test_a_png_has_fewer_dots_where_no_colours_are_few_enough(saved):
    png = saved(4000)
    assert 2000 < len(png) <= 4000
    height, width, _ = pixels(png).shape
    assert 50 < height < 200
    with Image.open(BytesIO(png)) as image:
        assert (width, height) == pytest.approx((1.5 * image.info["dpi"][0], 1.0 * image.info["dpi"][0]), abs=1)


@pytest.mark.parametrize("limit", [10**6, 30_000, 20_000, 4000])
def test_a_png_is_the_same_bytes_twice(saved, limit):
    png = saved(limit)
    assert len(png) <= limit
    assert saved(limit) == png


def test_a_wide_figure_is_no_wider_than_a_page(tmp_path):
    figure = style.plt.figure(figsize=(16, 1))
    style.save(figure, tmp_path / "wide.png")
    style.close(figure)
    assert pixels((tmp_path / "wide.png").read_bytes()).shape[1] == style.WIDEST_PNG
