def study_results(name):
    """Results of the cases of a study."""
    files = ("status.json", "volumes.nc", *(["measures.nc"] if LOADED.studies[name].measures else []))
    return [f"results/cases/{case.case_id}/{file}" for case in STUDIES[name].values() for file in files]


def study_targets(name):
    """Dataset and figures of a study."""
    figures = expand(
        "results/studies/{study}/figures/{figure}.{kind}", study=name, figure=LOADED.studies[name].figures, kind=["png", "pdf"]
    )
    fields = [
        f"results/cases/{case.case_id}/fields" for case in STUDIES[name].values() if "fields" in LOADED.studies[name].outputs
    ]
    return [f"results/studies/{name}/study.nc", *figures, *fields]
