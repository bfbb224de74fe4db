rule gather_study:
    message:
        "Gather {wildcards.study}"
    input:
        lambda wildcards: study_results(wildcards.study),
    output:
        "results/studies/{study}/study.nc",
    params:
        config_file=CONFIG_FILE,
        content=lambda wildcards: LOADED.content(wildcards.study),
        code=code_digest(GATHER_CODE),
    log:
        "results/logs/gather_study/{study}.log",
    conda:
        "../envs/limo.yaml"
    script:
        "../../scripts/gather_study.py"
