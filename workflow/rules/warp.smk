# Needs the labelled clouds of the source and of a target.
# Makes warp/<source>/<object>/: the source's points warped onto the target by both mappings, and how well they were aligned.
#       warp.npz, the warp itself, is for whoever wants to map something else (pipeline.warp.files).
#       For comparisons the same below warp/<source>/by/<method>_k<k>/, with the processor time of the fit.
# How: part frames, scaling by variance, nearest neighbours with fitting normals; or another of pipeline.warp.methods.

METHODS = schema["properties"]["warp"]["properties"]["method"]["enum"]


wildcard_constraints:
    method="|".join(METHODS),
    k=r"\d+",


# What `shape_space` learns from: warps by nearest neighbours, the workflow's own where that is what it warps by.
EXAMPLES = (
    "" if config["warp"]["method"] == "nearest_neighbour" else f"by/nearest_neighbour_k{config['warp']['k']}/"
)


def examples(method, source, target):
    """Return the warps of the source onto all objects but the target if the method is `shape_space`; none otherwise."""
    others = [name for name in OBJECTS if name not in (source, target)] if method == "shape_space" else []
    return [f"{PROCESSED}/warp/{source}/{EXAMPLES}{name}/warp.npz" for name in others]


rule warp:
    input:
        source=lambda wildcards: labels_from(wildcards.source, wildcards.source),
        target=lambda wildcards: labels_from(wildcards.source, wildcards.object),
        examples=lambda wildcards: examples(config["warp"]["method"], wildcards.source, wildcards.object),
    output:
        point=f"{PROCESSED}/warp/{{source}}/{{object}}/point_mapping.parquet",
        label=f"{PROCESSED}/warp/{{source}}/{{object}}/label_mapping.parquet",
        alignment=f"{PROCESSED}/warp/{{source}}/{{object}}/alignment.json",
        warp=f"{PROCESSED}/warp/{{source}}/{{object}}/warp.npz",
    log:
        "logs/warp/{source}/{object}.log",
    benchmark:
        "benchmarks/warp/{source}/{object}.tsv"
    threads: 1
    params:
        options=options("warp", "method", "k", "refinements", "bends", "seed"),
        code=code("pipeline.warp"),
    shell:
        "python -m pipeline.warp --source-labels {input.source:q} --target-labels {input.target:q}"
        " --point-mapping {output.point:q} --label-mapping {output.label:q} --alignment {output.alignment:q}"
        " --warp {output.warp:q} {params.options} --examples {input.examples:q} > {log:q} 2>&1"


WARP_BY = f"{PROCESSED}/warp/{{source}}/by/{{method}}_k{{k}}/{{object}}"


use rule warp as warp_by with:
    input:
        source=lambda wildcards: labels_from(wildcards.source, wildcards.source),
        target=lambda wildcards: labels_from(wildcards.source, wildcards.object),
        examples=lambda wildcards: examples(wildcards.method, wildcards.source, wildcards.object),
    output:
        point=f"{WARP_BY}/point_mapping.parquet",
        label=f"{WARP_BY}/label_mapping.parquet",
        alignment=f"{WARP_BY}/alignment.json",
        warp=f"{WARP_BY}/warp.npz",
        cpu=f"{WARP_BY}/cpu.json",
    log:
        "logs/warp/{source}/by/{method}_k{k}/{object}.log",
    benchmark:
        "benchmarks/warp/{source}/by/{method}_k{k}/{object}.tsv"
    params:
        options=lambda wildcards, output: (
            options("warp", "refinements", "bends", "seed")
            + f" --method {wildcards.method} --k {wildcards.k} --cpu {output.cpu}"
        ),
        code=code("pipeline.warp"),
