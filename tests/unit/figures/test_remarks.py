"""What is wrong with cases, or not physical about them, stands below every figure of a study."""

from importlib import import_module
from inspect import signature

import pytest
import xarray as xr

from limo.figures import style

FIGURES = {"pressure_volume": "pressure_volume", "kinematics": "kinematics", "buckling": "buckling", "design": "compliance"}


@pytest.mark.parametrize("figure", [*FIGURES, "strain_paths", "deformation"])
def test_remarks_and_reasons_stand_below(figure, root):
    name = FIGURES.get(figure, "kinematics" if figure == "deformation" else figure)
    dataset, shapes = (xr.load_dataset(root / f"docs/gallery/data/{name}{part}.nc") for part in ("", "_shapes"))
    first = {d: 0 for d in dataset.case_status.dims}
    remarks = xr.full_like(dataset.case_status, "layers lie on the wrong side: 4 % of the area", dtype=object)
    status, reason = (dataset[n].astype(object).copy() for n in ("case_status", "case_reason"))
    status[first], reason[first] = "degraded", "of little volume"
    told = dataset.assign(case_remarks=remarks, case_status=status, case_reason=reason)
    draw = import_module(f"limo.figures.{figure}").draw
    drawn = draw(told, None, *[shapes] * (len(signature(draw).parameters) - 2))
    texts = [t.get_text() for t in drawn.findobj(lambda a: hasattr(a, "get_text"))]
    for word in ("layers lie on the wrong side", "degraded, of little volume"):
        assert any(word in text for text in texts), word
    style.close(drawn)
