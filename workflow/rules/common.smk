# Longest first, so that the cores finish together, but what errors are measured against before; meshes before all, or the
# longest case would wait for its own.
ERROR_STUDIES = error_studies(LOADED)
KEPT_STUDIES = [name for name in ERROR_STUDIES if name.startswith(KEPT_PARTS)]
PRIORITIES = ranks(COSTS, {case_id for name in KEPT_STUDIES for case_id in PLAN.of_study(name)})
MESH_PRIORITIES = {MESH_IDS[name]: len(COSTS) + rank for name, rank in PRIORITIES.items()}
AIRBAG_RUNS = {name: runs_of(airbag) for name, airbag in LOADED.airbags.items()}


def mesh_of_case(wildcards):
    """The mesh of the case that a path names."""
    try:
        return f"results/meshes/{MESH_IDS[wildcards.case]}.vtu"
    except KeyError:
        raise WorkflowError(f"{wildcards.case}: no study of {CONFIG_FILE} uses this case") from None


def attempt_seconds(case):
    """How long an attempt at a case may take: the limit of the stress test holds for what no study asks for."""
    test, limit = LOADED.config.stress_test, LOADED.config.solver.time_limit
    if test and test.time_limit and case not in STUDIES.cases:
        limit = test.time_limit
    return round(60 * limit)


def mesh_content(wildcards):
    """What the mesh that a path names is made of."""
    try:
        return MESHES[wildcards.mesh].mesh_content()
    except KeyError:
        raise WorkflowError(f"{wildcards.mesh}: no study of {CONFIG_FILE} uses this mesh") from None


def caption(wildcards):
    """What the report says of a figure; the paths of captions know no wildcards, their texts do."""
    return Path(f"{workflow.basedir}/workflow/report/{wildcards.figure}.rst").read_text(encoding="utf-8")


def study_results(wildcards):
    """Results of the cases that serve a study, and of those it is compared with."""
    name = wildcards.study
    checks = [
        f"results/cases/{case_id}/{file}" for case_id in PLAN.checks_of_study(name) for file in ("status.json", "volumes.nc")
    ]
    files = ("status.json", "volumes.nc", *(["measures.nc"] if LOADED.studies[name].measures else []))
    return checks + [f"results/cases/{case_id}/{file}" for case_id in PLAN.of_study(name) for file in files]


def shape_results(wildcards):
    """Results of the cases that serve a study from which its figures of surfaces are drawn."""
    name = wildcards.study
    files = (
        "case.json",
        "volumes.nc",
        "frames.nc",
        *(["measures.nc"] if "fatigue" in items_of(LOADED.studies[name].figures) else []),
    )
    served = PLAN.of_study(name)
    meshes = dict.fromkeys(f"results/meshes/{MESH_IDS[case_id]}.vtu" for case_id in served)
    return [*meshes, *(f"results/cases/{case_id}/{file}" for case_id in served for file in files)]


def study_content(wildcards):
    """Digest of what a study's dataset depends on besides results: all its keys but words and figures."""
    content = LOADED.content(wildcards.study)
    numerics = [setting["numerics"] for setting in content["settings"].values()]
    for described in (content["study"], *content["study"]["variants"].values(), *numerics):
        del described["description"]
    return digest(content)


def measured_file(wildcards):
    """The measured curves of a study, nothing where it has none."""
    measured = LOADED.studies[wildcards.study].measured_curves
    return measured.data if measured else []


def measured_content(wildcards):
    """What is said of the measured curves of a study, and the code that reads and compares them."""
    measured = LOADED.studies[wildcards.study].measured_curves
    return digest([measured.model_dump(mode="json"), code_digest(CURVE_CODE)]) if measured else ""


def study_sources(wildcards):
    """Ids of the cases that serve a study, in the order of its grid, and of those it is compared with."""
    return list(PLAN.served[wildcards.study].values())


def study_targets(name):
    """Dataset, table and figures of a study; those of surfaces wait until this machine can render them."""
    shown = [figure for figure in LOADED.studies[name].figures if not (RENDERER_LACKS and figure in SHAPES)]
    figures = expand("results/studies/{study}/figures/{figure}.{kind}", study=name, figure=shown, kind=["png", "pdf"])
    drawn = PLAN.of_study(name) if "fields" in LOADED.studies[name].outputs else []
    datasets = [f"results/studies/{name}/{file}" for file in ("study.nc", "study.csv")]
    return [*datasets, *figures, *(f"results/cases/{case_id}/fields" for case_id in drawn)]


def fatigue_of(wildcards):
    """The strain-life curve where it is asked for; elsewhere only what tells seams from the rest."""
    asked = "fatigue" in PLAN.wanted[wildcards.case].pressures
    return LOADED.config.fatigue.model_dump(mode="json", include=None if asked else {"seam_distance"})


def airbag_run(wildcards):
    """The run of an airbag that a path names."""
    try:
        return AIRBAG_RUNS[wildcards.airbag][wildcards.run]
    except KeyError:
        raise WorkflowError(f"{wildcards.run}: no run of the airbag {wildcards.airbag} in {CONFIG_FILE}") from None


def build_of(engine):
    """The build of an engine that would solve, found when it is asked for."""
    try:
        if engine not in LOADED.builds:
            find_builds(LOADED, CONFIG_FILE, [engine])
    except LimoError as error:
        raise WorkflowError(str(error)) from None
    return LOADED.builds[engine]


def airbag_content(wildcards):
    """What a run of an airbag depends on, the build of its engine included."""
    run = airbag_run(wildcards)
    return {**run_content(LOADED.airbags[wildcards.airbag], run), "build": build_of(run.engine)}


def scaling_content(wildcards):
    """What the measured sizes of an engine depend on, its build included."""
    return {**LOADED.config.scaling.model_dump(mode="json"), "build": build_of(wildcards.engine)}


def airbag_results(wildcards):
    """Results of all runs of an airbag in the order of its configuration."""
    return expand("results/airbags/{airbag}/runs/{run}.nc", airbag=wildcards.airbag, run=AIRBAG_RUNS[wildcards.airbag])


def airbag_targets():
    """Figures of all airbags, and their rows beside the documentation; nothing without airbags."""
    figures = expand(
        ["docs/gallery/{airbag}_{figure}.png", "results/airbags/{airbag}/figures/{figure}.pdf"],
        airbag=LOADED.airbags,
        figure=AIRBAG_FIGURES,
    )
    return figures + ["docs/gallery/data/airbag.csv"] * bool(figures)


def served_by(name):
    """Ids of the cases that serve a study, in the order of its grid."""
    return [case_id for key, case_id in PLAN.served[name].items() if key[0] != CROSS_CHECK]


def runs_to_keep(wildcards):
    """What the runs of a study are gathered from that are not kept yet."""
    name = wildcards.study
    try:
        absent = lacking(LOADED, name, KEPT_FOLDER)
    except LimoError as error:
        raise WorkflowError(str(error)) from None
    served = [source for source, lacks in zip(served_by(name), absent, strict=True) if lacks]
    meshes = list(dict.fromkeys(f"results/meshes/{MESH_IDS[case_id]}.vtu" for case_id in served))
    files = ["case.json", "status.json", "volumes.nc", "frames.nc", *(["measures.nc"] if LOADED.studies[name].measures else [])]
    return meshes + expand("results/cases/{case}/{file}", case=served, file=files)


def error_results():
    """What the errors of the settings of all devices are gathered from."""
    gathered = [name for name in ERROR_STUDIES if name not in KEPT_STUDIES]
    served = list(dict.fromkeys(case_id for name in gathered for case_id in PLAN.of_study(name)))
    meshes = list(dict.fromkeys(f"results/meshes/{MESH_IDS[case_id]}.vtu" for case_id in served))
    cases = expand("results/cases/{case}/{file}", case=served, file=["case.json", "frames.nc"])
    kept = [str(kept_file(KEPT_FOLDER, name)) for name in KEPT_STUDIES] + expand("results/kept/{study}.txt", study=KEPT_STUDIES)
    timed = dict.fromkeys(case_id for name in gathered if name.startswith(TIMED_PARTS) for case_id in PLAN.of_study(name))
    times = expand("results/times/{case}.json", case=timed)
    sizes = expand("results/scaling/{engine}.csv", engine=ENGINES) if LOADED.config.scaling else []
    return [*kept, *expand("results/studies/{study}/study.nc", study=gathered), *meshes, *cases, *times, *sizes]


def device_targets():
    """Figures of the errors of the device, and the dataset that they are drawn from; nothing without a reference."""
    figures = expand("docs/gallery/{figure}.png", figure=DEVICE_FIGURES)
    return ["results/accuracy/accuracy.nc", *figures] if ERROR_STUDIES else []
