rule draw_figure:
    input:
        dataset="results/studies/{study}/study.nc",
        measured=lambda wildcards: LOADED.studies[wildcards.study].measured or [],
        style=f"{workflow.basedir}/scripts/limo/figures/style.py",
        source=f"{workflow.basedir}/scripts/limo/figures/{{figure}}.py",
    output:
        report(
            "results/studies/{study}/figures/{figure}.{kind}",
            caption="../report/{figure}.rst",
            category="{study}",
        ),
    log:
        "results/logs/draw_figure/{study}_{figure}_{kind}.log",
    conda:
        "../envs/limo.yaml"
    message:
        "Draw {wildcards.figure} of {wildcards.study} as {wildcards.kind}"
    script:
        "../../scripts/draw_figure.py"
