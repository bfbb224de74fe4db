rule gather_study:
    input:
        study_results,
        measured=measured_file,
    output:
        RESULTS.study("{study}").dataset,
    log:
        RESULTS.log("gather_study", "{study}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("gather_study"),
        runtime=minutes_of("gather_study"),
    params:
        content=study_content,
        sources=study_sources,
        code=code_digest("gather_study"),
        measured=measured_content,
    message:
        "Gather {wildcards.study}"
    script:
        "../../scripts/gather_study.py"


rule export_study:
    input:
        RESULTS.study("{study}").dataset,
    output:
        RESULTS.study("{study}").table,
    log:
        RESULTS.log("export_study", "{study}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("export_study"),
        runtime=minutes_of("export_study"),
    params:
        code=code_digest("export_study"),
    message:
        "Write {wildcards.study} as a table"
    script:
        "../../scripts/export_study.py"


rule gather_shapes:
    input:
        shape_results,
    output:
        RESULTS.study("{study}").shapes,
    log:
        RESULTS.log("gather_shapes", "{study}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("gather_shapes"),
        runtime=minutes_of("gather_shapes"),
    params:
        content=study_content,
        figures=lambda wildcards: items_of(PROJECT.studies[wildcards.study].figures),
        sources=study_sources,
        code=code_digest("gather_shapes"),
    message:
        "Gather the shapes of {wildcards.study}"
    script:
        "../../scripts/gather_shapes.py"
