rule solve_case:
    input:
        # its name says what it is made of, and params.code by which code: clocks that jump say nothing
        mesh=ancient(mesh_of_case),
    output:
        case="results/cases/{case}/case.json",
        status="results/cases/{case}/status.json",
        volumes="results/cases/{case}/volumes.nc",
        frames="results/cases/{case}/frames.nc",
    log:
        "results/logs/solve_case/{case}.log",
    benchmark:
        "results/benchmarks/solve_case/{case}.tsv"
    priority: lambda wildcards: PRIORITIES.get(wildcards.case, 0)
    conda:
        "../envs/limo.yaml"
    threads: LOADED.config.solver.threads
    resources:
        predicted_seconds=lambda wildcards: round(COSTS.get(wildcards.case, 0)),
        attempt_seconds=lambda wildcards: attempt_seconds(wildcards.case),
    params:
        case=case_of,
        code=lambda wildcards: solve_code(PLAN.cases[wildcards.case].engine),
        recovery=lambda wildcards: PLAN.recovery_of(wildcards.case),
    message:
        "Solve {wildcards.case}, predicted {resources.predicted_seconds} s of CPU time"
    script:
        "../../scripts/solve_case.py"
