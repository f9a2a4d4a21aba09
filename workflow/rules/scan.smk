# Needs scan.* of the configuration.
# Makes data/raw/<object>/ (depth images, poses, intrinsics) of every demonstration object, and its true geometry, which the report
#       alone reads.
# How: a virtual depth camera looks at a known shape on a table.

FRAMES = [f"frame-{number:06d}" for number in range(config["scan"]["views"])]


rule scan:
    output:
        depth=[f"{RAW}/{{object}}/{frame}.depth.png" for frame in FRAMES],
        poses=[f"{RAW}/{{object}}/{frame}.pose.txt" for frame in FRAMES],
        intrinsics=f"{RAW}/{{object}}/camera-intrinsics.txt",
        truth=multiext(f"{PROCESSED}/scan/{{object}}/truth", ".ply", ".parquet", ".json"),
    log:
        "logs/scan/{object}.log",
    benchmark:
        "benchmarks/scan/{object}.tsv"
    wildcard_constraints:
        object="|".join(FOUND.demonstration) or "(?!)",
    threads: 1
    params:
        raw=f"{RAW}/{{object}}",
        truth=f"{PROCESSED}/scan/{{object}}",
        options=options("scan", "views", "distance_m", "noise", "seed"),
        code=code("pipeline.scan"),
    shell:
        "python -m pipeline.scan --object {wildcards.object} --raw {params.raw:q} --truth {params.truth:q} {params.options}"
        " 2>&1 | tee {log:q} >&2"
