# The studies of the paper; their cases are shared, and each is solved once.
PAPER = [
    "kinematics",
    "pressure_volume",
    "buckling",
    "afterload",
    "stress",
    "fatigue",
    "strain_paths",
    "valve_support",
    "compliance",
    "deformation",
    "symmetry",
]


rule fit_material:
    input:
        data=LOADED.config.tensile_test.files,
        style=f"{workflow.basedir}/scripts/limo/figures/style.py",
        figure=f"{workflow.basedir}/scripts/limo/figures/tensile_test.py",
    output:
        dataset="results/material/tensile_test.nc",
        table="results/material/tensile_test.csv",
        png=report("results/material/tensile_test.png", caption="../report/tensile_test.rst", category="material"),
        pdf="results/material/tensile_test.pdf",
    log:
        "results/logs/fit_material.log",
    conda:
        "../envs/limo.yaml"
    params:
        test=LOADED.config.tensile_test.model_dump(mode="json"),
        code=code_digest(TENSILE_CODE),
    message:
        "Fit the modulus of the fabric"
    script:
        "../../scripts/fit_material.py"


rule check_paper:
    input:
        expand("results/studies/{study}/study.nc", study=[name for name in PAPER if name in LOADED.studies]),
    output:
        table="results/paper_check.csv",
        page="results/paper_check.md",
    log:
        "results/logs/check_paper.log",
    conda:
        "../envs/limo.yaml"
    params:
        code=code_digest(("paper_check",)),
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
        [study_targets(name) for name in PAPER if name in LOADED.studies],
        rules.fit_material.output,
        rules.check_paper.output,
    message:
        "All studies of the paper"
