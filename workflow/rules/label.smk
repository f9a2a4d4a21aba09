# Needs the fused cloud of an object, and cloud, frame and human annotation of the source.
# Makes label/classifier.json, what was learnt from the source; label/<object>/labels.parquet: probability and decision of container, rim
#       and handle at every point.
#       For further sources the same below label/<source>/, and label/<source>/annotation.parquet where no human annotated them:
#       the labels that they got from the first source.
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


def annotation_of(source):
    """Return the annotation of a source: the human one, or the labels that the first source gave it."""
    human = f"config/annotations/{source}.parquet"
    return human if os.path.isfile(human) else f"{PROCESSED}/label/{source}/annotation.parquet"


def labels_from(source, name):
    """Return the labels of an object as a source sees it."""
    return f"{PROCESSED}/label/{'' if source == SOURCE else source + '/'}{name}/labels.parquet"


rule adopt_labels:
    input:
        mapping=f"{PROCESSED}/warp/{SOURCE}/{{source}}/label_mapping.parquet",
        fusion=f"{PROCESSED}/fuse/{{source}}/fusion.json",
    output:
        annotation=f"{PROCESSED}/label/{{source}}/annotation.parquet",
    log:
        "logs/label/{source}/annotation.log",
    threads: 1
    params:
        code=code("pipeline.label.adopt"),
    shell:
        "python -m pipeline.label.adopt --mapping {input.mapping:q} --fusion {input.fusion:q} --annotation {output.annotation:q}"
        " > {log:q} 2>&1"


use rule learn as learn_from_further with:
    input:
        source_cloud=f"{PROCESSED}/fuse/{{source}}/cloud.parquet",
        source_fusion=f"{PROCESSED}/fuse/{{source}}/fusion.json",
        annotation=lambda wildcards: annotation_of(wildcards.source),
    output:
        classifier=f"{PROCESSED}/label/{{source}}/classifier.json",
    log:
        "logs/label/{source}/classifier.log",


use rule label as label_from_further with:
    input:
        source_cloud=f"{PROCESSED}/fuse/{{source}}/cloud.parquet",
        source_fusion=f"{PROCESSED}/fuse/{{source}}/fusion.json",
        annotation=lambda wildcards: annotation_of(wildcards.source),
        classifier=f"{PROCESSED}/label/{{source}}/classifier.json",
        cloud=rules.fuse.output.cloud,
    output:
        labels=f"{PROCESSED}/label/{{source}}/{{object}}/labels.parquet",
    log:
        "logs/label/{source}/{object}.log",
    benchmark:
        "benchmarks/label/{source}/{object}.tsv"
