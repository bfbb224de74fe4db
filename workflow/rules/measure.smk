rule measure_case:
    input:
        mesh=mesh_of_case,
        case=RESULTS.case("{case}").described,
        frames=RESULTS.case("{case}").frames,
        volumes=RESULTS.case("{case}").volumes,
    output:
        RESULTS.case("{case}").measures,
    log:
        RESULTS.log("measure_case", "{case}"),
    benchmark:
        RESULTS.benchmark("measure_case", "{case}")
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("measure_case"),
        runtime=minutes_of("measure_case"),
    params:
        wanted=lambda wildcards: wanted_of(wildcards).to_dict(),
        fatigue=fatigue_of,
        code=code_digest("measure_case"),
    message:
        "Measure {wildcards.case}"
    script:
        "../../scripts/measure_case.py"


rule write_fields:
    input:
        mesh=mesh_of_case,
        case=RESULTS.case("{case}").described,
        frames=RESULTS.case("{case}").frames,
        measures=RESULTS.case("{case}").measures,
    output:
        directory(RESULTS.case("{case}").fields),
    log:
        RESULTS.log("write_fields", "{case}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("write_fields"),
        runtime=minutes_of("write_fields"),
    params:
        wanted=lambda wildcards: wanted_of(wildcards).to_dict(),
        fatigue=fatigue_of,
        code=code_digest("write_fields"),
    message:
        "Write the fields of {wildcards.case} for ParaView"
    script:
        "../../scripts/write_fields.py"
