# Needs the labelled clouds of the source and of a target.
# Makes warp/<source>/<object>/: the source's points warped onto the target by both mappings, and how well they were aligned.
#       warp.npz, the warp itself, is for whoever wants to map something else (pipeline.warp.files).
# How: part frames, scaling by variance, nearest neighbours with fitting normals; or another of pipeline.warp.methods.


rule warp:
    input:
        source=lambda wildcards: labels_from(wildcards.source, wildcards.source),
        target=lambda wildcards: labels_from(wildcards.source, wildcards.object),
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
        " --warp {output.warp:q} {params.options} > {log:q} 2>&1"
