# Needs the trials of all objects and their parameters.
# Makes classify/<experiment>/: predictions, scores and ROC curves of every feature set, on the same and on novel objects,
#       and models.json, the classifiers as plain numbers.
# How: logistic regression by iteratively reweighted least squares on a few trials, tested on the rest.


rule classify:
    input:
        trials=each(f"{PROCESSED}/simulate/{{{{experiment}}}}/{{object}}/trials.parquet"),
        parameters=expand(rules.assemble_parameters.output, source=SOURCE)[0],
        tilt_references=expand(rules.assemble_tilt_references.output, source=SOURCE)[0],
    output:
        predictions=f"{PROCESSED}/classify/{{experiment}}/predictions.parquet",
        scores=f"{PROCESSED}/classify/{{experiment}}/scores.parquet",
        curves=f"{PROCESSED}/classify/{{experiment}}/curves.parquet",
        models=f"{PROCESSED}/classify/{{experiment}}/models.json",
    log:
        "logs/classify/{experiment}.log",
    benchmark:
        "benchmarks/classify/{experiment}.tsv"
    threads: 1
    params:
        options=options("classify", "samples", "draws", "ridge", "seed"),
        code=code("pipeline.classify"),
    shell:
        "python -m pipeline.classify --experiment {wildcards.experiment} --trials {input.trials:q} --parameters {input.parameters:q}"
        " --tilt-references {input.tilt_references:q} --predictions {output.predictions:q} --scores {output.scores:q}"
        " --curves {output.curves:q} --models {output.models:q} {params.options} > {log:q} 2>&1"
