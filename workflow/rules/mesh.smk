rule mesh_device:
    message:
        "Mesh {wildcards.mesh}"
    output:
        "results/meshes/{mesh}.vtu",
    params:
        content=lambda wildcards: MESHES[wildcards.mesh].mesh_content(),
        code=code_digest(MESH_CODE),
    log:
        "results/logs/mesh_device/{mesh}.log",
    benchmark:
        "results/benchmarks/mesh_device/{mesh}.tsv"
    conda:
        "../envs/limo.yaml"
    script:
        "../../scripts/mesh_device.py"
