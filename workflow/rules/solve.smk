rule solve_case:
    input:
        mesh=mesh_of_case,
        fit=fit_of_case,
    output:
        case=RESULTS.case("{case}").described,
        status=RESULTS.case("{case}").status,
        volumes=RESULTS.case("{case}").volumes,
        frames=RESULTS.case("{case}").frames,
    log:
        RESULTS.log("solve_case", "{case}"),
    benchmark:
        RESULTS.benchmark("solve_case", "{case}")
    priority: lambda wildcards: planned_for(wildcards.case).priorities.get(wildcards.case, 0)
    conda:
        "../envs/limo.yaml"
    threads: PROJECT.config.solver.threads
    resources:
        mem_mb=REQUESTS.memory_to_solve,
        runtime=REQUESTS.minutes_to_solve,
        predicted_seconds=REQUESTS.seconds_to_solve,
        attempt_seconds=lambda wildcards: attempt_seconds(wildcards.case),
    params:
        case=case_to_solve,
        code=lambda wildcards: solve_code(case_of(wildcards).engine),
        recovery=lambda wildcards: planned_for(wildcards.case).plan.recovery_of(wildcards.case),
    message:
        "Solve {wildcards.case}, predicted {resources.predicted_seconds} s of CPU time"
    script:
        "../../scripts/solve_case.py"
