rule gather_study:
    input:
        lambda wildcards: study_results(wildcards.study),
    output:
        "results/studies/{study}/study.nc",
    log:
        "results/logs/gather_study/{study}.log",
    conda:
        "../envs/limo.yaml"
    params:
        config_file=CONFIG_FILE,
        content=lambda wildcards: LOADED.content(wildcards.study),
        code=code_digest(GATHER_CODE),
    message:
        "Gather {wildcards.study}"
    script:
        "../../scripts/gather_study.py"
