rule stress_test:
    input:
        stress_test_results,
    output:
        RESULTS.stress_test,
    log:
        "results/logs/stress_test.log",
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("stress_test"),
        runtime=minutes_of("stress_test"),
    params:
        cases=stress_test_cases,
        code=code_digest("stress_test"),
    message:
        "Gather the stress test"
    script:
        "../../scripts/stress_test.py"
