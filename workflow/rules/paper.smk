rule fit_material:
    input:
        data=PROJECT.config.tensile_test.files,
    output:
        dataset=RESULTS.material("nc"),
        table=RESULTS.material("csv"),
        png=report(RESULTS.material("png"), caption="../report/tensile_test.rst", category="material"),
        pdf=RESULTS.material("pdf"),
    log:
        "results/logs/fit_material.log",
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("fit_material"),
        runtime=minutes_of("fit_material"),
    params:
        test=PROJECT.config.tensile_test.model_dump(mode="json"),
        code=code_digest("fit_material"),
    message:
        "Fit the modulus of the fabric"
    script:
        "../../scripts/fit_material.py"


rule check_paper:
    input:
        [RESULTS.study(name).dataset for name in PAPER if name in PROJECT.studies],
    output:
        table="results/paper_check.csv",
        page="results/paper_check.md",
    log:
        "results/logs/check_paper.log",
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("check_paper"),
        runtime=minutes_of("check_paper"),
    params:
        code=code_digest("check_paper"),
    message:
        "Test the statements of the paper"
    script:
        "../../scripts/check_paper.py"


rule material:
    input:
        rules.fit_material.output,
    message:
        "Modulus of the fabric"


rule paper:
    input:
        partial(targets_of, PAPER),
        rules.fit_material.output,
        rules.check_paper.output,
    message:
        "All studies of the paper"
