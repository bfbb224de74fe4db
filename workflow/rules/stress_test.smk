rule stress_test:
    input:
        [f"results/cases/{case_id}/{file}" for case_id in STRESS_TEST.values() for file in ("status.json", "volumes.nc")],
    output:
        "results/stress_test/cases.csv",
    log:
        "results/logs/stress_test.log",
    conda:
        "../envs/limo.yaml"
    params:
        cases=[[*key, case_id] for key, case_id in STRESS_TEST.items()],
        code=code_digest("stress_test"),
    message:
        "Gather the stress test"
    script:
        "../../scripts/stress_test.py"
