"""Whole files or none."""

import pytest

from limo.errors import ResultError
from limo.files import read_json, write_json, write_whole


def test_nothing_is_left_when_writing_fails(tmp_path):
    path = tmp_path / "result.nc"
    path.write_text("earlier")

    def fails(aside):
        aside.write_text("half")
        raise RuntimeError("disk full")

    with pytest.raises(RuntimeError, match="disk full"):
        write_whole(path, fails)
    assert [p.name for p in tmp_path.iterdir()] == ["result.nc"]
    assert path.read_text() == "earlier"


def test_result_appears_only_when_it_is_whole_and_keeps_its_ending(tmp_path):
    path = tmp_path / "new/folder/result.nc"
    seen = []

    def write(aside):
        seen.extend([path.exists(), aside.suffix, aside.parent == path.parent])
        aside.write_text("all")

    write_whole(path, write)
    assert seen == [False, ".nc", True]
    assert path.read_text() == "all"
    assert len(list(path.parent.iterdir())) == 1


def test_json_round_trip(tmp_path):
    data = {"a": 1.5, "b": [1, None], "c": {"d": "é"}}
    write_json(tmp_path / "a.json", data)
    assert read_json(tmp_path / "a.json") == data


@pytest.mark.parametrize("text", [b"", b"{", b"[1, 2]", b"\xff", b"null"])
def test_damaged_json_is_a_result_error(tmp_path, text):
    (tmp_path / "a.json").write_bytes(text)
    with pytest.raises(ResultError, match=r"a\.json"):
        read_json(tmp_path / "a.json")
    with pytest.raises(ResultError, match=r"absent\.json"):
        read_json(tmp_path / "absent.json")
