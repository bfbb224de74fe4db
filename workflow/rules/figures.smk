rule draw_figure:
    input:
        dataset=RESULTS.study("{study}").dataset,
        shapes=lambda wildcards: RESULTS.study(wildcards.study).shapes if wildcards.figure in SHAPES else [],
        measured=measured_file,
    output:
        report(
            RESULTS.study("{study}").figure("{figure}", "png"),
            caption="../report/figure.rst",
            category="{study}",
        ),
        RESULTS.study("{study}").figure("{figure}", "pdf"),
    log:
        RESULTS.log("draw_figure", "{study}_{figure}"),
    benchmark:
        RESULTS.benchmark("draw_figure", "{study}_{figure}")
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("draw_figure"),
        runtime=minutes_of("draw_figure"),
    params:
        caption=caption,
        code=figure_code,
        measured=measured_content,
    message:
        "Draw {wildcards.figure} of {wildcards.study}"
    script:
        "../../scripts/draw_figure.py"
