rule gather_study:
    input:
        study_results,
        measured=measured_file,
    output:
        "results/studies/{study}/study.nc",
    log:
        "results/logs/gather_study/{study}.log",
    conda:
        "../envs/limo.yaml"
    params:
        content=study_content,
        sources=study_sources,
        code=code_digest(GATHER_CODE),
        measured=measured_content,
    message:
        "Gather {wildcards.study}"
    script:
        "../../scripts/gather_study.py"


rule export_study:
    input:
        "results/studies/{study}/study.nc",
    output:
        "results/studies/{study}/study.csv",
    log:
        "results/logs/export_study/{study}.log",
    conda:
        "../envs/limo.yaml"
    params:
        code=code_digest(EXPORT_CODE),
    message:
        "Write {wildcards.study} as a table"
    script:
        "../../scripts/export_study.py"


rule gather_shapes:
    input:
        shape_results,
    output:
        "results/studies/{study}/shapes.nc",
    log:
        "results/logs/gather_shapes/{study}.log",
    conda:
        "../envs/limo.yaml"
    params:
        content=study_content,
        figures=lambda wildcards: items_of(LOADED.studies[wildcards.study].figures),
        sources=study_sources,
        code=code_digest(SHAPE_CODE),
    message:
        "Gather the shapes of {wildcards.study}"
    script:
        "../../scripts/gather_shapes.py"
