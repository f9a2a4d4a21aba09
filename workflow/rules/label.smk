# Needs the fused cloud of an object, and cloud, frame and human annotation of the source.
# Makes label/<object>/labels.parquet: probability and decision of container, rim and handle at every point.
# How: one logistic regression a part on local covariance features, trained on the source alone.


rule label:
    input:
        source_cloud=expand(rules.fuse.output.cloud, object=SOURCE)[0],
        source_fusion=expand(rules.fuse.output.report, object=SOURCE)[0],
        annotation=ANNOTATION,
        cloud=rules.fuse.output.cloud,
    output:
        labels=f"{PROCESSED}/label/{{object}}/labels.parquet",
    log:
        "logs/label/{object}.log",
    benchmark:
        "benchmarks/label/{object}.tsv"
    threads: 1
    params:
        options=options("label", "neighbours", "ridge"),
        code=code("pipeline.label"),
    shell:
        "python -m pipeline.label --source-cloud {input.source_cloud:q} --source-fusion {input.source_fusion:q}"
        " --annotation {input.annotation:q} --cloud {input.cloud:q} --labels {output.labels:q} {params.options} > {log:q} 2>&1"
