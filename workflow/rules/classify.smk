# Needs the trials of all objects and their parameters; with classify.volume or .margin also the scanned meshes or warped points.
# Makes classify/<experiment>/: predictions, scores and ROC curves of every feature set, on the same and on novel objects; models.json,
#       the classifiers as plain numbers; replicates and pairs, the scores resampled over objects and of each object on each;
#       learning.parquet, the same with fewer and more trials.
# How: logistic regression by iteratively reweighted least squares on a few trials, tested on the rest.

CLASSIFY = ["penalty", "ridge", "terms", "volume", "margin", "training_objects", "held_cups", "filled"]


rule classify:
    input:
        trials=each(f"{PROCESSED}/simulate/{{{{experiment}}}}/{{object}}/trials.parquet"),
        parameters=expand(rules.assemble_parameters.output, source=SOURCE)[0],
        tilt_references=expand(rules.assemble_tilt_references.output, source=SOURCE)[0],
        meshes=each(rules.fuse.output.mesh) if config["classify"]["volume"] == "cavity" else [],
        clouds=(
            each([rules.warp.output.point, rules.warp.output.label])
            if config["classify"]["margin"] == "hull"
            else []
        ),
    output:
        predictions=f"{PROCESSED}/classify/{{experiment}}/predictions.parquet",
        scores=f"{PROCESSED}/classify/{{experiment}}/scores.parquet",
        curves=f"{PROCESSED}/classify/{{experiment}}/curves.parquet",
        models=f"{PROCESSED}/classify/{{experiment}}/models.json",
        replicates=f"{PROCESSED}/classify/{{experiment}}/replicates.parquet",
        pairs=f"{PROCESSED}/classify/{{experiment}}/pairs.parquet",
    log:
        "logs/classify/{experiment}.log",
    benchmark:
        "benchmarks/classify/{experiment}.tsv"
    priority: 1
    threads: 1
    params:
        options=options("classify", "samples", "draws", *CLASSIFY, "resamples", "seed"),
        meshes=named("meshes", rules.fuse.output.mesh, config["classify"]["volume"] == "cavity"),
        clouds=named(
            "clouds", f"{PROCESSED}/warp/{SOURCE}/{{object}}", config["classify"]["margin"] == "hull"
        ),
        code=code("pipeline.classify"),
    shell:
        "python -m pipeline.classify --experiment {wildcards.experiment} --trials {input.trials:q} --parameters {input.parameters:q}"
        " --tilt-references {input.tilt_references:q} --predictions {output.predictions:q} --scores {output.scores:q}"
        " --curves {output.curves:q} --models {output.models:q} --replicates {output.replicates:q} --pairs {output.pairs:q}"
        " {params.options} {params.meshes} {params.clouds} 2>&1 | tee {log:q} >&2"


rule classify_learning:
    input:
        trials=rules.classify.input.trials,
        parameters=expand(rules.assemble_parameters.output, source=SOURCE)[0],
        tilt_references=expand(rules.assemble_tilt_references.output, source=SOURCE)[0],
        meshes=rules.classify.input.meshes,
        clouds=rules.classify.input.clouds,
    output:
        learning=f"{PROCESSED}/classify/{{experiment}}/learning.parquet",
    log:
        "logs/classify/{experiment}_learning.log",
    benchmark:
        "benchmarks/classify/{experiment}_learning.tsv"
    threads: 1
    params:
        options=options("classify", *CLASSIFY, "resamples", "seed", "learning_samples", "learning_draws"),
        meshes=rules.classify.params.meshes,
        clouds=rules.classify.params.clouds,
        code=code("pipeline.classify.learning"),
    shell:
        "python -m pipeline.classify.learning --experiment {wildcards.experiment} --trials {input.trials:q}"
        " --parameters {input.parameters:q} --tilt-references {input.tilt_references:q} --learning {output.learning:q}"
        " {params.options} {params.meshes} {params.clouds} 2>&1 | tee {log:q} >&2"
