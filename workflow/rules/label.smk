# Needs the fused cloud of an object, and cloud, frame and human annotation of the source.
# Makes label/classifier.json, what was learnt from the source; label/<object>/labels.parquet: probability and decision of container, rim
#       and handle at every point.
# How: one logistic regression a part on local covariance features, trained on the source alone.


rule learn:
    input:
        source_cloud=expand(rules.fuse.output.cloud, object=SOURCE)[0],
        source_fusion=expand(rules.fuse.output.report, object=SOURCE)[0],
        annotation=ANNOTATION,
    output:
        classifier=f"{PROCESSED}/label/classifier.json",
    log:
        "logs/label/classifier.log",
    threads: 1
    params:
        options=options("label", "neighbours", "ridge"),
        code=code("pipeline.label.learn"),
    shell:
        "python -m pipeline.label.learn --source-cloud {input.source_cloud:q} --source-fusion {input.source_fusion:q}"
        " --annotation {input.annotation:q} --classifier {output.classifier:q} {params.options} > {log:q} 2>&1"


rule label:
    input:
        source_cloud=rules.learn.input.source_cloud,
        source_fusion=rules.learn.input.source_fusion,
        annotation=ANNOTATION,
        classifier=rules.learn.output.classifier,
        cloud=rules.fuse.output.cloud,
    output:
        labels=f"{PROCESSED}/label/{{object}}/labels.parquet",
    log:
        "logs/label/{object}.log",
    benchmark:
        "benchmarks/label/{object}.tsv"
    threads: 1
    params:
        code=code("pipeline.label"),
    shell:
        "python -m pipeline.label --source-cloud {input.source_cloud:q} --source-fusion {input.source_fusion:q}"
        " --annotation {input.annotation:q} --classifier {input.classifier:q} --cloud {input.cloud:q} --labels {output.labels:q}"
        " > {log:q} 2>&1"
