checkpoint propose_designs:
    input:
        lambda wildcards: [RESULTS.exploration(wildcards.exploration).told(k) for k in range(int(wildcards.round))],
    output:
        RESULTS.exploration("{exploration}").round("{round}"),
    log:
        RESULTS.log("propose_designs", "{exploration}_{round}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("propose_designs"),
        runtime=minutes_of("propose_designs"),
    params:
        content=exploration_content,
        code=code_digest("propose_designs"),
    message:
        "Propose the designs of round {wildcards.round} of {wildcards.exploration}"
    script:
        "../../scripts/propose_designs.py"


rule tell_designs:
    input:
        results_of_designs,
        designs=RESULTS.exploration("{exploration}").round("{round}"),
    output:
        RESULTS.exploration("{exploration}").told("{round}"),
    log:
        RESULTS.log("tell_designs", "{exploration}_{round}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("tell_designs"),
        runtime=minutes_of("tell_designs"),
    params:
        sources=sources_of_designs,
        builds=lambda wildcards: dict(designs_on_disk().project.builds),
        code=code_digest("tell_designs"),
    message:
        "Tell what came of round {wildcards.round} of {wildcards.exploration}"
    script:
        "../../scripts/tell_designs.py"


rule report_exploration:
    input:
        told_of_exploration,
    output:
        RESULTS.exploration("{exploration}").dataset,
        RESULTS.exploration("{exploration}").page,
    log:
        RESULTS.log("report_exploration", "{exploration}"),
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("report_exploration"),
        runtime=minutes_of("report_exploration"),
    params:
        content=exploration_content,
        code=code_digest("report_exploration"),
    message:
        "Write what {wildcards.exploration} found"
    script:
        "../../scripts/report_exploration.py"


for name in EXPLORATIONS:

    rule:
        name:
            name
        input:
            RESULTS.exploration(name).page,
        message:
            f"Exploration {name}"
