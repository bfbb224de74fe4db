"""The classical square airbag on small meshes: its height and draw-in, and which elements lock."""

import numpy as np
import pytest

from limo.airbag import solve as airbag_solution
from limo.airbag.model import Run, build_model
from limo.airbag.solve import solve_run
from limo.config.load import load_config
from limo.engines.engine import EngineSettings
from limo.engines.find import find_engine
from limo.engines.newton.assembly import Assembly
from limo.schema.solver import Solver

from .conftest import ROOT


@pytest.fixture(scope="module")
def classical():
    return load_config(ROOT / "config/config.yaml").airbags["classical"]


@pytest.fixture(scope="module")
def solved(classical):
    def run(element: str, engine: str, divisions: int, planes: str = "hinged"):
        settings = EngineSettings(command=find_engine(engine).build(Solver(), "config/config.yaml").command)
        found = solve_run(classical, Run(element, engine, divisions, (100.0, 10.0), planes), settings)
        assert found.status.item() == "converged", found.reason.item()
        return found

    return run


HEIGHT, DRAW_IN = 216.7, 123.2  # mm, published: Jarasjarungkiat et al. 2009, 10 x 10, and the mean of u_B
TAUT = 600.0  # mm, half the diagonal, which carries the tension


@pytest.mark.parametrize(
    ("element", "engine", "divisions", "planes", "within"),
    [
        ("S8R", "calculix", 8, "hinged", 0.01),
        ("C3D20R", "newton", 8, "hinged", 0.01),
        ("C3D20R", "newton", 8, "symmetric", 0.03),
    ],
)
def test_quadratic_elements_reach_the_published_height(solved, element, engine, divisions, planes, within):
    found = solved(element, engine, divisions, planes)
    height, corner = found.height.item(), found.corner_draw_in.item()
    assert height == pytest.approx(HEIGHT, rel=within)
    straight = ((TAUT - corner * 2**0.5) ** 2 + height**2) ** 0.5
    assert 0.98 * TAUT < straight < 1.01 * TAUT, "the diagonal is taut and hardly stretched"
    if engine == "calculix":  # the engine newton need not put the same folds there on every processor
        assert found.edge_draw_in_smooth.item() == pytest.approx(DRAW_IN, rel=0.05)


def test_what_the_fully_integrated_shell_misses_is_its_own_and_not_the_solver_s(solved):
    shell, brick = solved("S8", "calculix", 8).height.item(), solved("C3D20", "newton", 8).height.item()
    assert shell == pytest.approx(brick, rel=5e-3)
    assert brick < 0.97 * HEIGHT


def test_a_state_at_rest_has_the_least_potential_energy_around_it(classical, tmp_path):
    run = Run("C3D20R", "newton", 6, (100.0, 10.0))
    model = build_model(classical, run)
    path = find_engine("newton").inflate(model, (*run.path, 1.0), tmp_path, EngineSettings())
    assert path.status == "converged"
    rest = path.displacements(len(path.stage) - 1)
    assembly, rng = Assembly(model), np.random.default_rng(3)
    lowest = airbag_solution.potential_energy(model, rest)
    for _ in range(5):
        way = rng.normal(size=assembly.size)
        way = assembly.expand(way / np.abs(way).max())
        up, down = (airbag_solution.potential_energy(model, rest + size * way) for size in (0.01, -0.01))
        assert up > lowest
        assert down > lowest
        slope, bend = (up - down) / 2, (up + down) / 2 - lowest
        assert abs(slope) < 0.02 * bend, "at 0.01 mm the first derivative is nothing beside the second"


@pytest.mark.parametrize(
    ("element", "divisions", "height"),
    [
        ("S8R", 4, 210.36),  # with fewer degrees of freedom than any other here
        ("S3", 8, 196.92),  # locks
        ("S8", 4, 144.36),  # locks
        ("S4R", 8, 5.21),  # hardly inflates
    ],
)
def test_heights_on_small_meshes_are_those_that_the_documentation_has(solved, element, divisions, height):
    """Both builds of CalculiX give them to the last digit."""
    assert solved(element, "calculix", divisions).height.item() == pytest.approx(height, rel=5e-3)
