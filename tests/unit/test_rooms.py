"""The rooms of the package: no circle, no arrow upwards, and none of those that must never be."""

import pytest

from limo.reports.rooms import ORDER, PACKAGE, arrows

#: room -> rooms that it must never import from
NEVER = {
    "schema": set(ORDER) - {"schema"},
    "store": set(ORDER) - {"store", "errors"},
    "geometry": {"config", "cases"},
    "mesh": {"config", "cases"},
    "mechanics": {"engines", "config"},
    "engines": {"config", "solve", "measure"},
    "measure": {"engines", "solve"},
    "solve": {"datasets"},
    "datasets": {"engines", "solve"},
    "figures": {"engines", "solve", "config", "cases"},
    "page": {"engines", "solve"},
}


@pytest.fixture(scope="module")
def found(root):
    return arrows(root / PACKAGE)


def test_every_room_has_its_place_in_the_order(root):
    package = root / PACKAGE
    rooms = {path.stem for path in package.iterdir() if (path / "__init__.py").exists() or path.suffix == ".py"}
    assert rooms - {"__init__"} == set(ORDER)


def test_rooms_import_from_rooms_below_them_only(found):
    upward = {arrow: by for arrow, by in found.items() if ORDER.index(arrow[1]) > ORDER.index(arrow[0])}
    assert not upward, "an order without arrows upwards has no circles either"


def test_there_are_no_arrows_that_must_never_be(found):
    wrong = {arrow: by for arrow, by in found.items() if arrow[1] in NEVER.get(arrow[0], ())}
    wrong |= {arrow: by for arrow, by in found.items() if arrow[1] == "terminal"}
    wrong |= {arrow: by for arrow, by in found.items() if arrow[1] == "reports" and arrow[0] != "terminal"}
    assert not wrong
