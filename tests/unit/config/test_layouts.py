"""Layouts are tried once: a good one is known afterwards, a bad one is refused each time."""

from __future__ import annotations

import pytest

from limo.config import layouts
from limo.errors import ConfigError
from limo.geometry import pattern as geometry


@pytest.fixture
def tried(monkeypatch, tmp_path):
    """Numbers of pouches of the layouts that were tried, with an empty memory."""
    monkeypatch.setattr(layouts, "FILE", tmp_path / "cache" / "layouts.json")
    layouts.known_layouts.cache_clear()
    numbers, cut = [], geometry.flat_pattern
    monkeypatch.setattr(geometry, "flat_pattern", lambda *parts: numbers.append(parts[1]) or cut(*parts))
    yield numbers
    layouts.known_layouts.cache_clear()


def test_a_layout_is_tried_once_and_known_to_others(loaded, tried):
    pattern = loaded.devices["limo"].pattern
    layouts.check_layouts(pattern, [4, 6], "limo.yaml")
    layouts.check_layouts(pattern, [6, 8], "limo.yaml")
    assert tried == [4, 6, 8]
    layouts.known_layouts.cache_clear()  # another process
    layouts.check_layouts(pattern, [4, 6, 8], "limo.yaml")
    assert tried == [4, 6, 8]
    layouts.check_layouts(pattern.model_copy(update={"width_scale": 0.95}), [4], "limo.yaml")
    assert tried == [4, 6, 8, 4]


def test_a_layout_that_cannot_be_cut_is_refused_each_time(loaded, tried):
    seams = loaded.devices["limo"].pattern.seams.model_copy(update={"fractions": {10: [0.5, 0.505]}})
    pattern = loaded.devices["limo"].pattern.model_copy(update={"seams": seams})
    for _ in range(2):
        with pytest.raises(ConfigError, match=r"limo\.yaml: pattern\.seams\.fractions\.10 = 0\.505"):
            layouts.check_layouts(pattern, [10], "limo.yaml")
    assert tried == [10, 10]


@pytest.mark.parametrize("content", ["", "{}", "[1, null]", "\x00"])
def test_a_damaged_memory_is_none(loaded, tried, content):
    layouts.FILE.parent.mkdir()
    layouts.FILE.write_text(content)
    layouts.check_layouts(loaded.devices["limo"].pattern, [4], "limo.yaml")
    assert tried == [4]


def test_other_code_of_patterns_tries_anew(loaded, tried, monkeypatch):
    pattern = loaded.devices["limo"].pattern
    layouts.check_layouts(pattern, [4], "limo.yaml")
    monkeypatch.setattr(layouts, "code_digest", lambda *_: "other")
    layouts.check_layouts(pattern, [4], "limo.yaml")
    assert tried == [4, 4]
