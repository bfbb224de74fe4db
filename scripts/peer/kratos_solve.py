"""One solve by Kratos, in an environment that has it: ``python kratos_solve.py CASE MODEL N`` prints a line of JSON.

The model ``relaxed_3n``: membranes of three nodes that bear no compression (the wrinkling law of Kratos over plane stress).
Explicit dynamics with damping by mass brings them to rest. Planes of symmetry are hinges, which a membrane always has.
"""

from __future__ import annotations

import json
import math
import resource
import sys

import KratosMultiphysics as Kratos
import KratosMultiphysics.ConstitutiveLawsApplication as Laws
import KratosMultiphysics.StructuralMechanicsApplication as Structural
import numpy as np
from cases import CASES, Sheet, crossed, measure, mesh, on_edge

#: at rest nothing moves further than this share of the size while the damping takes a speed away; and the most steps
SLOW, STEPS = 1e-5, 60_000
#: the pressure grows for so many times of the damping
RAMP = 5.0
VARIABLES = (
    Kratos.DISPLACEMENT,
    Kratos.VELOCITY,
    Kratos.ACCELERATION,
    Kratos.REACTION,
    Kratos.VOLUME_ACCELERATION,
    Kratos.NODAL_MASS,
    Kratos.FORCE_RESIDUAL,
    Kratos.RESIDUAL_VECTOR,
    Kratos.POSITIVE_FACE_PRESSURE,
    Kratos.NEGATIVE_FACE_PRESSURE,
    Structural.MIDDLE_VELOCITY,
    Structural.SURFACE_LOAD,
    Structural.POINT_LOAD,
)


def build(part: Kratos.ModelPart, sheet: Sheet, nodes: np.ndarray, triangles: np.ndarray, edge: np.ndarray) -> None:
    """Nodes, membranes, their law, what is held, and where the pressure acts."""
    part.ProcessInfo[Kratos.DOMAIN_SIZE] = 3
    part.ProcessInfo[Kratos.COMPUTE_LUMPED_MASS_MATRIX] = True
    for variable in VARIABLES:
        part.AddNodalSolutionStepVariable(variable)
    wrinkled, taut = part.CreateNewProperties(1), part.CreateNewProperties(2)
    for properties in (wrinkled, taut):
        properties.SetValue(Kratos.YOUNG_MODULUS, sheet.youngs_modulus)
        properties.SetValue(Kratos.POISSON_RATIO, sheet.poisson_ratio)
        properties.SetValue(Kratos.THICKNESS, sheet.thickness)
        properties.SetValue(Kratos.DENSITY, sheet.density)
    taut.SetValue(Kratos.CONSTITUTIVE_LAW, Structural.LinearElasticPlaneStress2DLaw())
    wrinkled.SetValue(Kratos.CONSTITUTIVE_LAW, Laws.WrinklingLinear2DLaw())
    wrinkled.SetValue(Structural.PRESTRESS_VECTOR, Kratos.Vector([0.0, 0.0, 0.0]))
    wrinkled.AddSubProperties(taut)
    directions = (Kratos.DISPLACEMENT_X, Kratos.DISPLACEMENT_Y, Kratos.DISPLACEMENT_Z)
    for number, (x, y) in enumerate(nodes, 1):
        part.CreateNewNode(number, x, y, 0.0)
    for direction, reaction in zip(directions, (Kratos.REACTION_X, Kratos.REACTION_Y, Kratos.REACTION_Z), strict=True):
        Kratos.VariableUtils().AddDof(direction, reaction, part)
    for number, triangle in enumerate((triangles + 1).tolist(), 1):
        part.CreateNewElement("MembraneElement3D3N", number, triangle, wrinkled)
        part.CreateNewCondition("SurfaceLoadCondition3D3N", number, triangle, wrinkled)
    for node, (x, y), is_edge in zip(part.Nodes, nodes, edge, strict=True):
        for direction, is_held in zip(directions, (x < 1e-9, y < 1e-9, is_edge), strict=True):
            if is_held:
                node.Fix(direction)
    part.SetBufferSize(2)


def relax(part: Kratos.ModelPart, sheet: Sheet, shortest: float) -> tuple[int, bool]:
    """Central differences until what moves is slow: steps, and whether it is. ``shortest`` (m) of the edges."""
    step = 0.5 * shortest / math.sqrt(sheet.youngs_modulus / sheet.density / (1 - sheet.poisson_ratio**2))
    damping = 3 * math.sqrt(sheet.pressure / (sheet.density * sheet.thickness * sheet.size))
    part.ProcessInfo[Structural.RAYLEIGH_ALPHA] = damping
    part.ProcessInfo[Structural.RAYLEIGH_BETA] = 0.0
    scheme = Structural.ExplicitCentralDifferencesScheme(step, 1.0, 0.0)
    strategy = Structural.MechanicalExplicitStrategy(part, scheme, False, False, True)
    strategy.SetRebuildLevel(0)
    strategy.Initialize()
    utilities = Kratos.VariableUtils()
    for count in range(1, STEPS + 1):
        share = min(1.0, count * step * damping / RAMP)
        if share < 1.0 or (count - 1) * step * damping < RAMP:
            utilities.SetVariable(Kratos.NEGATIVE_FACE_PRESSURE, share * sheet.pressure, part.Nodes)  # from below
        part.CloneTimeStep(count * step)
        strategy.InitializeSolutionStep()
        strategy.SolveSolutionStep()
        strategy.FinalizeSolutionStep()
        if count % 50 == 0 and share == 1.0:
            speed = np.abs(np.array(utilities.GetSolutionStepValuesVector(part.Nodes, Kratos.VELOCITY, 0, 3))).max()
            if speed < SLOW * damping * sheet.size:
                return count, True
    return STEPS, False


def main(case: str, n: int) -> None:
    """Solve and print what came out, what it cost and how it ended."""
    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    nodes, triangles = crossed(*mesh(case, n))
    box = Kratos.Model()  # a part does not outlive it
    part = box.CreateModelPart("sheet", 2)
    build(part, CASES[case], nodes, triangles, on_edge(case, nodes))
    shortest = min(np.linalg.norm(nodes[triangles[:, k]] - nodes[triangles[:, k - 1]], axis=1).min() for k in range(3))
    before = resource.getrusage(resource.RUSAGE_SELF)
    steps, converged = relax(part, CASES[case], shortest)
    after = resource.getrusage(resource.RUSAGE_SELF)
    moved = np.array([list(node.GetSolutionStepValue(Kratos.DISPLACEMENT)) for node in part.Nodes])
    found = measure(case, nodes, triangles, moved)
    found |= {
        "version": Kratos.Kernel.Version().split("-")[0].replace('"', ""),
        "elements": len(triangles),
        "iterations": steps,
        "converged": converged,
        "cpu_seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        "memory_mib": after.ru_maxrss / 1024,
    }
    print(json.dumps(found))


main(sys.argv[1], int(sys.argv[3]))
