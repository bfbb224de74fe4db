rule mesh_device:
    output:
        RESULTS.mesh("{mesh}"),
    log:
        RESULTS.log("mesh_device", "{mesh}"),
    benchmark:
        RESULTS.benchmark("mesh_device", "{mesh}")
    priority: lambda wildcards: planned_mesh(wildcards.mesh).mesh_priorities.get(wildcards.mesh, 0)
    conda:
        "../envs/limo.yaml"
    resources:
        mem_mb=memory_of("mesh_device"),
        runtime=minutes_of("mesh_device"),
    params:
        content=mesh_content,
        code=code_digest("mesh_device"),
    message:
        "Mesh {wildcards.mesh}"
    script:
        "../../scripts/mesh_device.py"
