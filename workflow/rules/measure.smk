rule measure_case:
    input:
        mesh=mesh_of_case,
        case="results/cases/{case}/case.json",
        frames="results/cases/{case}/frames.nc",
        volumes="results/cases/{case}/volumes.nc",
    output:
        "results/cases/{case}/measures.nc",
    log:
        "results/logs/measure_case/{case}.log",
    benchmark:
        "results/benchmarks/measure_case/{case}.tsv"
    conda:
        "../envs/limo.yaml"
    params:
        wanted=lambda wildcards: PLAN.wanted[wildcards.case].to_dict(),
        fatigue=fatigue_of,
        code=code_digest("measure_case"),
    message:
        "Measure {wildcards.case}"
    script:
        "../../scripts/measure_case.py"


rule write_fields:
    input:
        mesh=mesh_of_case,
        case="results/cases/{case}/case.json",
        frames="results/cases/{case}/frames.nc",
        measures="results/cases/{case}/measures.nc",
    output:
        directory("results/cases/{case}/fields"),
    log:
        "results/logs/write_fields/{case}.log",
    conda:
        "../envs/limo.yaml"
    params:
        wanted=lambda wildcards: PLAN.wanted[wildcards.case].to_dict(),
        fatigue=fatigue_of,
        code=code_digest("write_fields"),
    message:
        "Write the fields of {wildcards.case} for ParaView"
    script:
        "../../scripts/write_fields.py"
