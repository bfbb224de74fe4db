rule measure_case:
    input:
        mesh=lambda wildcards: f"results/meshes/{CASES[wildcards.case].mesh_id}.vtu",
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
        case=lambda wildcards: CASES[wildcards.case].to_dict(),
        wanted=lambda wildcards: WANTED[wildcards.case].to_dict(),
        fatigue=LOADED.config.fatigue.model_dump(mode="json"),
        code=code_digest(MEASURE_CODE),
    message:
        "Measure {wildcards.case}"
    script:
        "../../scripts/measure_case.py"


rule write_fields:
    input:
        mesh=lambda wildcards: f"results/meshes/{CASES[wildcards.case].mesh_id}.vtu",
        frames="results/cases/{case}/frames.nc",
        measures="results/cases/{case}/measures.nc",
    output:
        directory("results/cases/{case}/fields"),
    log:
        "results/logs/write_fields/{case}.log",
    conda:
        "../envs/limo.yaml"
    params:
        case=lambda wildcards: CASES[wildcards.case].to_dict(),
        wanted=lambda wildcards: WANTED[wildcards.case].to_dict(),
        fatigue=LOADED.config.fatigue.model_dump(mode="json"),
        code=code_digest((*FIELD_CODE, "vtu")),
    message:
        "Write the fields of {wildcards.case} for ParaView"
    script:
        "../../scripts/write_fields.py"
