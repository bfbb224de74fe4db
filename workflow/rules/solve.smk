rule solve_case:
    input:
        mesh=lambda wildcards: f"results/meshes/{CASES[wildcards.case].mesh_id}.vtu",
    output:
        status="results/cases/{case}/status.json",
        volumes="results/cases/{case}/volumes.nc",
        frames="results/cases/{case}/frames.nc",
    log:
        "results/logs/solve_case/{case}.log",
    benchmark:
        "results/benchmarks/solve_case/{case}.tsv"
    conda:
        "../envs/limo.yaml"
    threads: LOADED.config.solver.threads
    params:
        case=lambda wildcards: CASES[wildcards.case].to_dict(),
        solver=LOADED.config.solver.model_dump(mode="json"),
        command=str(CCX),
        code=lambda wildcards: code_digest(SOLVE_CODE[CASES[wildcards.case].engine]),
    message:
        "Solve {wildcards.case}"
    script:
        "../../scripts/solve_case.py"


# The longest first, so that the cores finish together: fewer pouches move further and snap more often.
use rule solve_case as solve_long_case with:
    output:
        status=f"results/cases/{{case,{LONG_CASES}}}/status.json",
        volumes=f"results/cases/{{case,{LONG_CASES}}}/volumes.nc",
        frames=f"results/cases/{{case,{LONG_CASES}}}/frames.nc",
    priority: 1


ruleorder: solve_long_case > solve_case
