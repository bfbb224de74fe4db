from functools import cache, partial
from types import SimpleNamespace

ERROR_STUDIES = error_studies(PROJECT)
KEPT_STUDIES = [name for name in ERROR_STUDIES if is_kept(PROJECT.studies[name])]


@cache
def planned(tested=False):
    """The plan of the studies, or of these and the stress test, with costs (s), priorities and meshes of its cases.

    Longest first, so that the cores finish together, but what errors are measured against before; meshes before all, or the
    longest case would wait for its own.
    """
    plan = PLAN
    if tested:
        from limo.reliability.stress_cases import stress_cases

        plan = PLAN.with_cases(stress_cases(PROJECT).values())
    return ordered(plan, {case_id for name in KEPT_STUDIES for case_id in PLAN.of_study(name)})


def ordered(plan, first=frozenset(), **more):
    """A plan with costs (s), priorities and meshes of its cases; those of ``first`` come before the others."""
    costs = plan_costs(plan)
    priorities = ranks(costs, first)
    mesh_priorities = {plan.cases[name].mesh_id: len(costs) + rank for name, rank in priorities.items()}
    meshes = {case.mesh_id: case for case in plan.cases.values()}
    return SimpleNamespace(plan=plan, costs=costs, priorities=priorities, mesh_priorities=mesh_priorities, meshes=meshes, **more)


def planned_for(case_id):
    """The plan that holds a case: of designs and of the stress test only where no study asks for the case."""
    if case_id not in PLAN.cases and case_id in designs_on_disk().plan.cases:
        return designs_on_disk()
    return planned(tested=case_id not in PLAN.cases)


def planned_mesh(mesh_id):
    """The same for a mesh."""
    if mesh_id not in planned().meshes and mesh_id in designs_on_disk().meshes:
        return designs_on_disk()
    return planned(tested=mesh_id not in planned().meshes)


def wanted_of(wildcards):
    """What is measured of the case that a path names."""
    return planned_for(wildcards.case).plan.wanted[wildcards.case]


@cache
def exploration(name):
    """An exploration, read when it is asked for, or when a case is that of no study."""
    from limo.explore.rounds import read_exploration

    try:
        return read_exploration(PROJECT, Path(CONFIG_FILE), name)
    except LimoError as error:
        raise WorkflowError(str(error)) from None


def designs_on_disk():
    """The plan of the designs that explorations have proposed so far, as ``planned``; ``project`` has them as studies."""
    files = sorted(RESULTS.explorations.glob("*/round_*.json"))
    return _designs_of(tuple((str(file), file.stat().st_mtime_ns) for file in files))


@cache
def _designs_of(rounds):
    from limo.explore.rounds import explored

    begun = {Path(file).parent.name for file, _ in rounds} & set(EXPLORATIONS)
    project = explored(PROJECT, {name: exploration(name) for name in sorted(begun)}, RESULTS)
    if not project.studies:
        return SimpleNamespace(project=PROJECT, plan=SimpleNamespace(cases={}), meshes={})
    project = project.with_builds({**PROJECT.builds, **{engine: build_of(engine) for engine in project.engines}})
    return ordered(make_plan(project), project=project)


def exploration_content(wildcards):
    """What the designs of an exploration depend on besides results."""
    return digest(exploration(wildcards.exploration).model_dump(mode="json"))


def sources_of_designs(wildcards):
    """Ids of the cases that serve each design of a round; none as long as nobody knows the designs."""
    from limo.explore.rounds import round_designs

    try:
        names = round_designs(RESULTS, wildcards.exploration, int(wildcards.round))
    except LimoError:
        return {}
    return {name: designs_on_disk().plan.sources(name) for name in names}


def results_of_designs(wildcards):
    """Results of the cases of a round, once its designs are known."""
    checkpoints.propose_designs.get(exploration=wildcards.exploration, round=wildcards.round)
    cases = [RESULTS.case(case_id) for ids in sources_of_designs(wildcards).values() for case_id in ids]
    return [file for case in cases for file in (case.status, case.volumes, case.measures)]


def told_of_exploration(wildcards):
    """What came of all rounds of an exploration, the last one included."""
    from limo.explore.rounds import count_of

    rounds = count_of(exploration(wildcards.exploration))
    return [RESULTS.exploration(wildcards.exploration).told(k) for k in range(rounds)]


def case_of(wildcards):
    """The case that a path names."""
    try:
        return planned_for(wildcards.case).plan.cases[wildcards.case]
    except KeyError:
        raise WorkflowError(f"{wildcards.case}: no study of {CONFIG_FILE} uses this case") from None


def mesh_of_case(wildcards):
    """The mesh of the case that a path names."""
    return RESULTS.mesh(case_of(wildcards).mesh_id)


def fit_of_case(wildcards):
    """The mesh, case and frames at whose state at rest the case that a path names begins; nothing where it begins flat."""
    fit = case_of(wildcards).fit
    files = RESULTS.case(fit.case_id) if fit else None
    return [RESULTS.mesh(fit.mesh_id), files.described, files.frames] if fit else []


def attempt_seconds(case_id):
    """How long an attempt at a case may take: the limit of the stress test holds for what no study asks for."""
    test, limit = PROJECT.config.stress_test, PROJECT.config.solver.time_limit
    if test and test.time_limit and case_id not in PLAN.cases and case_id not in designs_on_disk().plan.cases:
        limit = test.time_limit
    return round(60 * limit)


def mesh_content(wildcards):
    """What the mesh that a path names is made of."""
    try:
        return planned_mesh(wildcards.mesh).meshes[wildcards.mesh].mesh_content()
    except KeyError:
        raise WorkflowError(f"{wildcards.mesh}: no study of {CONFIG_FILE} uses this mesh") from None


def caption(wildcards):
    """What the report says of a figure; the paths of captions know no wildcards, their texts do."""
    return Path(f"{workflow.basedir}/workflow/report/{wildcards.figure}.rst").read_text(encoding="utf-8")


def figure_code(wildcards):
    """Hash of the code that draws a figure."""
    return code_digest("draw_figure", f"limo.figures.{wildcards.figure}")


def meshes_of(case_ids):
    """The meshes of cases, each once."""
    return list(dict.fromkeys(RESULTS.mesh(PLAN.cases[case_id].mesh_id) for case_id in case_ids))


def study_results(wildcards):
    """Results of the cases that serve a study, and of those it is compared with."""
    name = wildcards.study
    checks, served = (map(RESULTS.case, ids) for ids in (PLAN.checks_of_study(name), PLAN.of_study(name)))
    measured = bool(PROJECT.studies[name].measures)
    files = [file for case in checks for file in (case.status, case.volumes)]
    return files + [file for case in served for file in (case.status, case.volumes, *[case.measures] * measured)]


def shape_results(wildcards):
    """Results of the cases that serve a study from which its figures of surfaces are drawn."""
    name = wildcards.study
    measured = "fatigue" in items_of(PROJECT.studies[name].figures)
    served = PLAN.of_study(name)
    cases = [
        file
        for case in map(RESULTS.case, served)
        for file in (case.described, case.volumes, case.frames, *[case.measures] * measured)
    ]
    return meshes_of(served) + cases


def study_content(wildcards):
    """Digest of what a study's dataset depends on besides results: all its keys but words and figures."""
    content = PROJECT.content(wildcards.study)
    numerics = [setting["numerics"] for setting in content["settings"].values()]
    for described in (content["study"], *content["study"]["variants"].values(), *numerics):
        del described["description"]
    return digest(content)


def measured_file(wildcards):
    """The measured curves of a study, nothing where it has none."""
    measured = PROJECT.studies[wildcards.study].measured_curves
    return measured.data if measured else []


def measured_content(wildcards):
    """Digest of what is said of the measured curves of a study, and of the code that reads them."""
    measured = PROJECT.studies[wildcards.study].measured_curves
    code = code_digest("limo.bench.compare:study_curves")
    return digest([measured.model_dump(mode="json"), code]) if measured else ""


def study_sources(wildcards):
    """Ids of the cases that serve a study, in the order of its grid, and of those it is compared with."""
    return PLAN.sources(wildcards.study)


def study_targets(name, wildcards=None):
    """Dataset, table and figures of a study; those of surfaces wait until this machine can render them."""
    study, files = PROJECT.studies[name], RESULTS.study(name)
    shown = [figure for figure in study.figures if not (RENDERER_LACKS and figure in SHAPES)]
    figures = [files.figure(figure, kind) for figure in shown for kind in ("png", "pdf")]
    drawn = PLAN.of_study(name) if "fields" in study.outputs else []
    return [files.dataset, files.table, *figures, *(RESULTS.case(case_id).fields for case_id in drawn)]


def targets_of(names, wildcards=None):
    """The same of those of some studies that there are; a broken one is refused."""
    try:
        for name in names:
            PROJECT.require_sound(f"studies/{name}")
    except LimoError as error:
        raise WorkflowError(str(error)) from None
    return [file for name in names if name in PROJECT.studies for file in study_targets(name)]


def fatigue_of(wildcards):
    """The strain-life curve where it is asked for; elsewhere only what tells seams from the rest."""
    asked = "fatigue" in wanted_of(wildcards).pressures
    return PROJECT.config.fatigue.model_dump(mode="json", include=None if asked else {"seam_distance"})


def stress_test_cases(wildcards=None):
    """The cases of the stress test: box, number in it, engine and id."""
    from limo.reliability.stress_cases import stress_cases

    try:
        PROJECT.require_sound("stress_test")
        return [[*key, case.case_id] for key, case in stress_cases(PROJECT).items()]
    except LimoError as error:
        raise WorkflowError(str(error)) from None


def stress_test_results(wildcards):
    """Results of the cases of the stress test."""
    cases = [RESULTS.case(case_id) for *_, case_id in stress_test_cases()]
    return [file for case in cases for file in (case.status, case.volumes)]


@cache
def airbag_runs(airbag):
    """The runs of an airbag by their names."""
    from limo.airbag.model import runs_of

    return runs_of(PROJECT.airbags[airbag])


def airbag_run(wildcards):
    """The run of an airbag that a path names."""
    try:
        return airbag_runs(wildcards.airbag)[wildcards.run]
    except KeyError:
        raise WorkflowError(f"{wildcards.run}: no run of the airbag {wildcards.airbag} in {CONFIG_FILE}") from None


@cache
def build_of(engine):
    """The build of an engine that would solve, found when it is asked for."""
    try:
        builds = PROJECT.builds if engine in PROJECT.builds else with_found_builds(PROJECT, CONFIG_FILE, [engine])[0].builds
        if HANDED:
            HANDED.check_build(engine, builds[engine])
    except LimoError as error:
        raise WorkflowError(str(error)) from None
    return builds[engine]


def case_to_solve(wildcards):
    """The case that a path names as plain data, if its engine is on this machine."""
    case = case_of(wildcards)
    build_of(case.engine)
    return case.to_dict()


def airbag_content(wildcards):
    """What a run of an airbag depends on, the build of its engine included."""
    from limo.airbag.model import run_content

    run = airbag_run(wildcards)
    return {**run_content(PROJECT.airbags[wildcards.airbag], run), "build": build_of(run.engine)}


def scaling_content(wildcards):
    """What the measured sizes of an engine depend on, its build included."""
    return {**PROJECT.config.scaling.model_dump(mode="json"), "build": build_of(wildcards.engine)}


def airbag_results(wildcards):
    """Results of all runs of an airbag in the order of its configuration."""
    return [RESULTS.airbag(wildcards.airbag).run(run) for run in airbag_runs(wildcards.airbag)]


def airbag_targets():
    """Figures of all airbags, and their rows beside the documentation; nothing without airbags."""
    pictures = [f"docs/gallery/{airbag}_{figure}.png" for airbag in PROJECT.airbags for figure in AIRBAG_FIGURES]
    prints = [RESULTS.airbag(airbag).figure(figure, "pdf") for airbag in PROJECT.airbags for figure in AIRBAG_FIGURES]
    return [*pictures, *prints, *["docs/gallery/data/airbag.csv"] * bool(pictures)]


def runs_to_keep(wildcards):
    """What the runs of a study are gathered from that are not kept yet."""
    name = wildcards.study
    try:
        absent = lacking(PROJECT, name, KEPT_FOLDER)
    except LimoError as error:
        raise WorkflowError(str(error)) from None
    served = [source for source, lacks in zip(PLAN.serving(name), absent, strict=True) if lacks]
    measured = bool(PROJECT.studies[name].measures)
    cases = [file for case in map(RESULTS.case, served) for file in (*case.solved, *[case.measures] * measured)]
    return meshes_of(served) + cases


def error_results(wildcards):
    """What the errors of the settings of all devices are gathered from."""
    kept = [file for name in KEPT_STUDIES for file in (kept_file(KEPT_FOLDER, name), RESULTS.kept_names(name))]
    gathered = [name for name in ERROR_STUDIES if name not in KEPT_STUDIES]
    served = list(dict.fromkeys(case_id for name in gathered for case_id in PLAN.of_study(name)))
    cases = [file for case in map(RESULTS.case, served) for file in (case.described, case.frames)]
    timed = dict.fromkeys(i for name in gathered if is_timed(PROJECT.studies[name]) for i in PLAN.of_study(name))
    sizes = [RESULTS.scaling(engine) for engine in ENGINES] if PROJECT.config.scaling else []
    datasets = [RESULTS.study(name).dataset for name in gathered]
    return [*kept, *datasets, *meshes_of(served), *cases, *map(RESULTS.times, timed), *sizes]


def device_targets():
    """Figures of the errors of the device, and the dataset that they are drawn from; nothing without a reference."""
    figures = expand("docs/gallery/{figure}.png", figure=DEVICE_FIGURES)
    return [RESULTS.accuracy, *figures] if ERROR_STUDIES else []


def accuracy_targets(wildcards):
    """All measured errors; refused where a file is broken, because nobody knows whether its rows would be lost."""
    try:
        PROJECT.require_all()
    except LimoError as error:
        raise WorkflowError(str(error)) from None
    return airbag_targets() + device_targets()
