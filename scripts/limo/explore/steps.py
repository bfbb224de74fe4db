"""The steps of an exploration: to propose the designs of a round, and to tell what came of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from limo.config.project import Project
from limo.explore.designs import can_be_made, own_design, space_of, written
from limo.explore.learn import Learned
from limo.explore.recommend import recommended
from limo.explore.rounds import is_last, preset_of, round_designs
from limo.explore.sampling import sample
from limo.explore.search import propose
from limo.explore.telling import Told, tell
from limo.schema.exploration import AS_IT_IS, Exploration
from limo.store.files import read_json
from limo.store.results import Results


def propose_round(project: Project, name: str, exploration: Exploration, number: int, results: Results) -> dict[str, Any]:
    """The designs of a round, from what came of those before; what is written into its file."""
    space, allowed = space_of(exploration), can_be_made(project, exploration)
    own = own_design(exploration, project.devices[exploration.device])
    expected: list[float] = []
    if number == 0:
        designs = [
            written(exploration, d) for d in space.from_unit(sample(space, exploration.rounds[0], exploration.seed, allowed))
        ]
        designs = [own, *designs[:-1]] if own else designs
        why = [""] * len(designs)
    else:
        learned = learn(exploration, results, name, number)
        if is_last(exploration, number):
            picked = recommended(learned, exploration.budget[exploration.fine] - bool(own))
            designs, why = [learned.design(k) for k in picked.values()], list(picked)
            designs, why = ([own, *designs], [AS_IT_IS, *why]) if own else (designs, why)
        else:
            designs, expected = _next(exploration, learned, number, allowed)
            why = [""] * len(designs)
    named = {f"{name}_{number:02d}_{k:03d}": design for k, design in enumerate(designs)}
    return {
        "exploration": exploration.model_dump(mode="json"),
        "preset": preset_of(exploration, number),
        "designs": named,
        "why": dict(zip(named, why, strict=True)),
        "expected": expected,
    }


def _next(exploration: Exploration, learned: Learned, number: int, allowed) -> tuple[list[dict[str, float]], list[float]]:
    """Designs that are expected to add most; samples as long as nothing can be learned."""
    count, knowledge = exploration.rounds[number], learned.knowledge()
    if knowledge is None:
        begun = len(learned.places)
        places = sample(learned.space, begun + count, exploration.seed, allowed)[begun:]
        return [written(exploration, design) for design in learned.space.from_unit(places)], []
    proposal = propose(learned.space, knowledge, count, exploration.seed + 1000 * number, allowed)
    return [written(exploration, design) for design in learned.space.from_unit(proposal.places)], proposal.expected.tolist()


def tell_round(
    project: Project, name: str, exploration: Exploration, number: int, results: Results, sources: Mapping[str, list[str]]
) -> dict[str, Any]:
    """What came of a round's designs, which are studies of ``project``, as it is written: status, reason, quantities, scatter.

    ``sources``: ids of the cases that serve each.
    """
    told = {
        design: asdict(tell(project, exploration, design, results.cases, sources[design]))
        for design in round_designs(results, name, number)
    }
    return {"told": {design: _plain(each) for design, each in told.items()}}


def _plain(told: dict[str, Any]) -> dict[str, Any]:
    """Numbers that are none as null."""
    return {
        key: {n: (None if not np.isfinite(v) else v) for n, v in value.items()} if isinstance(value, dict) else value
        for key, value in told.items()
    }


def learn(exploration: Exploration, results: Results, name: str, until: int) -> Learned:
    """What all rounds before ``until`` teach, the last one not among them. Raises ``ResultError``."""
    designs: list[dict[str, float]] = []
    told: list[Told] = []
    for number in range(until):
        kept = read_json(results.exploration(name).told(number))["told"]
        for design, values in round_designs(results, name, number).items():
            designs.append(values)
            told.append(told_of(kept[design]))
    return learned_of(exploration, designs, told)


def learned_of(exploration: Exploration, designs: Sequence[Mapping[str, float]], told: Sequence[Told]) -> Learned:
    """What designs (``written``) and what came of them teach."""
    space = space_of(exploration)
    return Learned(exploration, space, space.to_unit(designs), list(told), list(designs))


def told_of(kept: Mapping[str, Any]) -> Told:
    """What a file says of a design."""
    values, scatter = ({n: np.nan if v is None else float(v) for n, v in kept[key].items()} for key in ("values", "scatter"))
    return Told(kept["status"], kept["reason"], values, scatter)
