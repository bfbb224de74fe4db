rule mesh_device:
    output:
        "results/meshes/{mesh}.vtu",
    log:
        "results/logs/mesh_device/{mesh}.log",
    benchmark:
        "results/benchmarks/mesh_device/{mesh}.tsv"
    priority: lambda wildcards: MESH_PRIORITIES.get(wildcards.mesh, 0)
    conda:
        "../envs/limo.yaml"
    params:
        content=mesh_content,
        code=code_digest("mesh_device"),
    message:
        "Mesh {wildcards.mesh}"
    script:
        "../../scripts/mesh_device.py"
