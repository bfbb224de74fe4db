rule draw_figure:
    input:
        dataset="results/studies/{study}/study.nc",
        shapes=lambda wildcards: f"results/studies/{wildcards.study}/shapes.nc" if wildcards.figure in SHAPES else [],
        measured=measured_file,
        style=expand(f"{workflow.basedir}/scripts/limo/figures/{{name}}.py", name=["style", "overlay"]),
        pictures=lambda wildcards: (
            expand(f"{workflow.basedir}/scripts/limo/figures/{{name}}.py", name=["pictures", "render", "surface"])
            if wildcards.figure in SHAPES
            else []
        ),
        source=f"{workflow.basedir}/scripts/limo/figures/{{figure}}.py",
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
        measured=measured_content,
    message:
        "Draw {wildcards.figure} of {wildcards.study}"
    script:
        "../../scripts/draw_figure.py"
