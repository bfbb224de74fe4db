rule solve_airbag:
    output:
        RESULTS.airbag("{airbag}").run("{run}"),
    log:
        RESULTS.log("solve_airbag", "{airbag}_{run}"),
    conda:
        "../envs/limo.yaml"
    threads: PROJECT.config.solver.threads
    resources:
        mem_mb=memory_of("solve_airbag"),
        runtime=minutes_of("solve_airbag"),
    params:
        content=airbag_content,
        code=lambda wildcards: code_digest("solve_airbag", engine_code(airbag_run(wildcards).engine, "inflate")),
    message:
        "Inflate the airbag {wildcards.airbag} with {wildcards.run}"
    script:
        "../../scripts/solve_airbag.py"


rule gather_airbag:
    input:
        airbag_results,
    output:
        RESULTS.airbag("{airbag}").dataset,
    log:
        RESULTS.log("gather_airbag", "{airbag}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("gather_airbag"),
        runtime=minutes_of("gather_airbag"),
    params:
        content=lambda wildcards: PROJECT.airbags[wildcards.airbag].model_dump(mode="json"),
        code=code_digest("gather_airbag"),
    message:
        "Gather the airbag {wildcards.airbag}"
    script:
        "../../scripts/gather_airbag.py"


rule draw_airbag:
    input:
        dataset=RESULTS.airbag("{airbag}").dataset,
        shapes=[],
        measured=[],
    output:
        report(
            "docs/gallery/{airbag}_{figure}.png",
            caption="../report/figure.rst",
            category="accuracy",
        ),
        RESULTS.airbag("{airbag}").figure("{figure}", "pdf"),
    log:
        RESULTS.log("draw_airbag", "{airbag}_{figure}"),
    wildcard_constraints:
        figure="|".join(AIRBAG_FIGURES),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("draw_airbag"),
        runtime=minutes_of("draw_airbag"),
    params:
        caption=caption,
        code=figure_code,
    message:
        "Draw {wildcards.figure} of the airbag {wildcards.airbag}"
    script:
        "../../scripts/draw_figure.py"


rule keep_airbags:
    input:
        [RESULTS.airbag(airbag).dataset for airbag in PROJECT.airbags],
    output:
        "docs/gallery/data/airbag.csv",
    log:
        "results/logs/keep_airbags.log",
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("keep_airbags"),
        runtime=minutes_of("keep_airbags"),
    params:
        code=code_digest("keep_airbags"),
    message:
        "Keep the rows of the airbags"
    script:
        "../../scripts/keep_airbags.py"


# solved once: where all its runs are kept already, nothing is needed to keep them. That they are is written into the results,
# because a file that lacks some looks done where nothing was solved yet
rule keep_runs:
    input:
        runs_to_keep,
    output:
        update(kept_file(KEPT_FOLDER, "{study}")),
        RESULTS.kept_names("{study}"),
    log:
        RESULTS.log("keep_runs", "{study}"),
    wildcard_constraints:
        study="|".join(KEPT_STUDIES) or "none",
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("keep_runs"),
        runtime=minutes_of("keep_runs"),
    params:
        sources=lambda wildcards: PLAN.serving(wildcards.study),
    message:
        "Keep the runs of {wildcards.study}"
    script:
        "../../scripts/keep_runs.py"


rule time_case:
    input:
        mesh=mesh_of_case,
        fit=fit_of_case,
        status=RESULTS.case("{case}").status,
    output:
        RESULTS.times("{case}"),
    log:
        RESULTS.log("time_case", "{case}"),
    conda:
        "../envs/limo.yaml"
    threads: PROJECT.config.solver.threads
    resources:
        mem_mb=REQUESTS.memory_to_solve,
        runtime=REQUESTS.minutes_to_time,
    params:
        case=case_to_solve,
    message:
        "Time {wildcards.case} again where that is short"
    script:
        "../../scripts/time_case.py"


# alone on the machine, whose memory it fills: more threads than any run has cores are cut down to all of them
rule measure_scaling:
    output:
        RESULTS.scaling("{engine}"),
    log:
        RESULTS.log("measure_scaling", "{engine}"),
    wildcard_constraints:
        engine="|".join(ENGINES),
    conda:
        "../envs/limo.yaml"
    threads: 4096
    resources:
        mem_mb=memory_of("measure_scaling"),
        runtime=minutes_of("measure_scaling"),
    params:
        content=scaling_content,
        code=lambda wildcards: code_digest("measure_scaling", engine_code(wildcards.engine, "sample")),
    message:
        "Iterate ever larger models with {wildcards.engine}"
    script:
        "../../scripts/measure_scaling.py"


rule gather_accuracy:
    input:
        error_results,
    output:
        RESULTS.accuracy,
        "docs/gallery/data/accuracy.nc",
    log:
        "results/logs/gather_accuracy.log",
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("gather_accuracy"),
        runtime=minutes_of("gather_accuracy"),
    params:
        sources=lambda wildcards: {name: PLAN.serving(name) for name in ERROR_STUDIES},
        presets=digest({name: preset.model_dump(mode="json") for name, preset in PROJECT.config.presets.items()}),
        code=code_digest("gather_accuracy"),
    message:
        "Gather the errors of the settings of the device"
    script:
        "../../scripts/gather_accuracy.py"


rule draw_accuracy:
    input:
        dataset=RESULTS.accuracy,
        shapes=[],
        measured=[],
    output:
        report(
            "docs/gallery/{figure}.png",
            caption="../report/figure.rst",
            category="accuracy",
        ),
        "results/accuracy/figures/{figure}.pdf",
    log:
        "results/logs/draw_accuracy/{figure}.log",
    wildcard_constraints:
        figure="|".join(DEVICE_FIGURES),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("draw_accuracy"),
        runtime=minutes_of("draw_accuracy"),
    params:
        caption=caption,
        code=figure_code,
    message:
        "Draw {wildcards.figure} of the device"
    script:
        "../../scripts/draw_figure.py"


rule accuracy:
    input:
        accuracy_targets,
    message:
        "Measured errors"
