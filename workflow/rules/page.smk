rule page:
    input:
        templates=expand(f"{workflow.basedir}/scripts/limo/page/{{file}}", file=TEMPLATES),
        # by their whole paths, which are no rule's output: nothing is solved or gathered for the page
        found=lambda wildcards: sources(RESULTS.root, PROJECT.studies),
    output:
        "results/index.html",
    log:
        "results/logs/page.log",
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("page"),
        runtime=minutes_of("page"),
    params:
        studies=lambda wildcards: {name: (study.description, study.figures) for name, study in PROJECT.studies.items()},
        code=code_digest("write_page"),
    message:
        "Gather what is there into a page"
    script:
        "../../scripts/write_page.py"
