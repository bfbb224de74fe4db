rule draw_figure:
    input:
        dataset="results/studies/{study}/study.nc",
        shapes=lambda wildcards: f"results/studies/{wildcards.study}/shapes.nc" if wildcards.figure in SHAPES else [],
        measured=lambda wildcards: LOADED.studies[wildcards.study].measured or [],
    output:
        report(
            "results/studies/{study}/figures/{figure}.png",
            caption="../report/figure.rst",
            category="{study}",
        ),
        "results/studies/{study}/figures/{figure}.pdf",
    log:
        "results/logs/draw_figure/{study}_{figure}.log",
    benchmark:
        "results/benchmarks/draw_figure/{study}_{figure}.tsv"
    conda:
        "../envs/limo.yaml"
    params:
        caption=caption,
        code=figure_code,
    message:
        "Draw {wildcards.figure} of {wildcards.study}"
    script:
        "../../scripts/draw_figure.py"
