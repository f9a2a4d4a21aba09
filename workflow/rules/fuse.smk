# Needs everything in data/raw/<object>/.
# Makes fuse/<object>/: mesh.ply and cloud.parquet, the object's surface upright on z = 0, and fusion.json, how that came about.
# How: the layout is recognised, poses are checked or found, the table removed, the views fused, the surface sampled.


def raw_files(wildcards):
    """Return what the scan stage writes for a demonstration object, all that is there for a dropped one."""
    if wildcards.object in FOUND.demonstration:
        scanned = rules.scan.output
        return expand([*scanned.depth, *scanned.poses, scanned.intrinsics], object=wildcards.object)
    return objects.files(f"{RAW}/{wildcards.object}")


rule fuse:
    input:
        raw_files,
        compiled=compiled("fuse"),
    output:
        mesh=f"{PROCESSED}/fuse/{{object}}/mesh.ply",
        cloud=f"{PROCESSED}/fuse/{{object}}/cloud.parquet",
        report=f"{PROCESSED}/fuse/{{object}}/fusion.json",
    log:
        "logs/fuse/{object}.log",
    benchmark:
        "benchmarks/fuse/{object}.tsv"
    threads: 1
    params:
        raw=f"{RAW}/{{object}}",
        options=options("fuse", "voxel_m", "truncation_m", "points", "seed"),
        code=code("pipeline.fuse"),
    shell:
        "python -m pipeline.fuse --raw {params.raw:q} --mesh {output.mesh:q} --cloud {output.cloud:q} --report {output.report:q}"
        " {params.options} 2>&1 | tee {log:q} >&2"
