"""The steps of an exploration: to propose the designs of a round, and to tell what came of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from limo.config.project import Project
from limo.explore.designs import can_be_made, own_design, space_of, written
from limo.explore.learn import Corrected, Learned
from limo.explore.recommend import recommended
from limo.explore.rounds import count_of, is_fine, preset_of, round_designs
from limo.explore.sampling import sample
from limo.explore.search import Knowledge, propose
from limo.explore.telling import Told, tell
from limo.schema.exploration import AS_IT_IS, HELD_OUT, SEARCHED_FINELY, Exploration
from limo.store.files import read_json
from limo.store.results import Results

#: designs as they are written, by why they are there
Proposed = dict[str, dict[str, float]]
#: batches that are not worth it before the search ends
PATIENCE = 2


def propose_round(project: Project, name: str, exploration: Exploration, number: int, results: Results) -> dict[str, Any]:
    """The designs of a round, from what came of those before; what is written into its file."""
    allowed = can_be_made(project, exploration)
    own = own_design(exploration, project.devices[exploration.device])
    designs, expected = {}, []
    if number == 0:
        designs = _first(exploration, own, allowed)
    elif not is_fine(exploration, number):
        if not is_over(exploration, results, name, number):
            designs, expected = _next(exploration, learn(exploration, results, name, number), number, allowed)
    else:
        cheap, first = learn(exploration, results, name, len(exploration.rounds)), len(exploration.rounds)
        if number == first:
            picked = recommended(cheap, exploration.fine_rounds[0] - bool(own))
            designs = ({AS_IT_IS: own} if own else {}) | {why: cheap.design(k) for why, k in picked.items()}
        else:
            fine = _solved_in(exploration, results, name, range(first, number))
            designs, expected = _finer(exploration, Corrected(cheap, fine), number, allowed)
    named = {f"{name}_{number:02d}_{k:03d}": design for k, design in enumerate(designs.values())}
    return {
        "exploration": exploration.model_dump(mode="json"),
        "preset": preset_of(exploration, number),
        "designs": named,
        "why": dict(zip(named, designs, strict=True)),
        "expected": expected,
    }


def _first(exploration: Exploration, own: dict[str, float] | None, allowed) -> Proposed:
    """Samples, the last of which makes room for the device as it is; then those that are held out."""
    space = space_of(exploration)
    places = sample(space, exploration.rounds[0], exploration.seed, allowed)
    designs = [written(exploration, design) for design in space.from_unit(places)]
    learned, tested = designs[: exploration.beginning], designs[exploration.beginning :]
    learned = [own, *learned[:-1]] if own else learned
    return {f"sample {k}": d for k, d in enumerate(learned)} | {f"{HELD_OUT} {k}": d for k, d in enumerate(tested)}


def _next(exploration: Exploration, learned: Learned, number: int, allowed) -> tuple[Proposed, list[float]]:
    """Designs that are expected to add most; samples as long as nothing can be learned."""
    count, knowledge = exploration.rounds[number], learned.knowledge()
    if knowledge is None:
        begun = sum(exploration.rounds[:number])
        places = sample(learned.space, begun + count, exploration.seed, allowed)[begun:]
        return {f"sample {k}": written(exploration, d) for k, d in enumerate(learned.space.from_unit(places))}, []
    return _searched(learned, knowledge, count, number, allowed, "search")


def _finer(exploration: Exploration, corrected: Corrected, number: int, allowed) -> tuple[Proposed, list[float]]:
    """Designs that both presets together expect to add most to what the finer one solved; nothing where they know too little."""
    if (knowledge := corrected.knowledge()) is None:
        return {}, []
    return _searched(corrected.cheap, knowledge, exploration.fine_rounds[-1], number, allowed, f"{SEARCHED_FINELY},")


def _searched(learned: Learned, known: Knowledge, count: int, number: int, allowed, why: str) -> tuple[Proposed, list[float]]:
    """Designs that are expected to add most to what is known, and how much each of them is."""
    exploration, space = learned.exploration, learned.space
    proposal = propose(space, known, count, exploration.seed + 1000 * number, allowed)
    designs = space.from_unit(proposal.places)
    return {f"{why} {k + 1}": written(exploration, d) for k, d in enumerate(designs)}, proposal.expected.tolist()


def is_over(exploration: Exploration, results: Results, name: str, number: int) -> bool:
    """Whether the search has ended before a round: nothing in the last batches was worth it."""
    kept = [read_json(results.exploration(name).round(k)) for k in range(1, number)][-PATIENCE:]
    if any(not each["designs"] for each in kept):
        return True
    return len(kept) == PATIENCE and all(each["expected"] and max(each["expected"]) < exploration.worth for each in kept)


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
    return {
        "told": {design: _plain(each) for design, each in told.items()},
        "cases": {design: list(sources[design]) for design in told},
    }


def _plain(told: dict[str, Any]) -> dict[str, Any]:
    """Numbers that are none as null."""
    return {
        key: {n: (None if not np.isfinite(v) else v) for n, v in value.items()} if isinstance(value, dict) else value
        for key, value in told.items()
    }


def learn(exploration: Exploration, results: Results, name: str, until: int) -> Learned:
    """What all rounds before ``until`` teach, but for designs that are held out. Raises ``ResultError``."""
    return _solved_in(exploration, results, name, range(until), lambda why: not why.startswith(HELD_OUT))


def held_out(exploration: Exploration, results: Results, name: str) -> Learned:
    """What came of the designs that are held out. Raises ``ResultError``."""
    return _solved_in(exploration, results, name, [0], lambda why: why.startswith(HELD_OUT))


def solved_finely(exploration: Exploration, results: Results, name: str) -> tuple[Learned, dict[str, str]]:
    """What came of the designs that the finer preset solved; their names, and why each is there. Raises ``ResultError``."""
    numbers = range(len(exploration.rounds), count_of(exploration))
    why = {}
    for number in numbers:
        why |= read_json(results.exploration(name).round(number))["why"]
    return _solved_in(exploration, results, name, numbers), why


def _solved_in(
    exploration: Exploration, results: Results, name: str, numbers: Iterable[int], wanted: Callable[[str], bool] = lambda _: True
) -> Learned:
    """What came of the designs of rounds that are wanted, by why they are there."""
    designs: list[dict[str, float]] = []
    told: list[Told] = []
    for number in numbers:
        why = read_json(results.exploration(name).round(number))["why"]
        kept = read_json(results.exploration(name).told(number))["told"]
        for design, values in round_designs(results, name, number).items():
            if wanted(why[design]):
                designs.append(values)
                told.append(told_of(kept[design]))
    return learned_of(exploration, designs, told)


def learned_of(exploration: Exploration, designs: Sequence[Mapping[str, float]], told: Sequence[Told]) -> Learned:
    """What designs (``written``) and what came of them teach."""
    space = space_of(exploration)
    places = space.to_unit(designs).reshape(-1, len(space.inputs))
    return Learned(exploration, space, places, list(told), list(designs))


def told_of(kept: Mapping[str, Any]) -> Told:
    """What a file says of a design."""
    values, scatter = ({n: np.nan if v is None else float(v) for n, v in kept[key].items()} for key in ("values", "scatter"))
    return Told(kept["status"], kept["reason"], values, scatter)
