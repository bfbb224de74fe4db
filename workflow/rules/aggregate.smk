rule gather_study:
    input:
        study_results,
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
    message:
        "Gather {wildcards.study}"
    script:
        "../../scripts/gather_study.py"
