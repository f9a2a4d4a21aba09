# Needs what the stages made: scans, labels, trials.
# Makes ablate/<variant>/: the classifiers' resampled scores with one key of the configuration changed, with what that moves on
#       the way; all when reports/ablations.pdf is asked for, and nothing else does.
# How: the stages' own rules, with the changed key. Trials are those of the default run unless the key moves them; then
#       they are fewer (ablate.trials). Sources beside the annotated one take the labels that it was warped onto them with.

import copy

ABLATE = f"{PROCESSED}/ablate"
# Variant: the key that it changes and its value there.
VARIANTS = {
    "default": ("", None),
    **{f"k_{k}": ("warp.k", k) for k in (5, 20)},
    "paper_alignment": ("warp.refinements", 0),
    # Not the rigid method: a mug that keeps its size puts no rim on a wide bowl, which then has no parameters.
    **{f"method_{method}": ("warp.method", method) for method in METHODS if method != "rigid"},
    **{f"source_{name}": ("objects.source", name) for name in ("tall_cup", "jug", "wide_bowl")},
    "true_cavity": ("classify.volume", "cavity"),
    "quadratic_terms": ("classify.terms", "quadratic"),
    "margin": ("classify.margin", "hull"),
    **{f"training_objects_{n}": ("classify.training_objects", n) for n in (2, 5)},
    "disjoint_held_cups": ("classify.held_cups", "disjoint"),
    "filled_none_spilled": ("classify.filled", "none_spilled"),
    "filled_some_arrive": ("classify.filled", "some_arrive"),
    "absolute_ranges": ("simulate.ranges", "absolute"),
    **{
        f"ridge_{str(ridge).replace('.', '_')}": ("classify.ridge", ridge)
        for ridge in (0.01, 0.1, 10.0, 100.0)
    },
    "firth": ("classify.penalty", "firth"),
}

# Keys that one experiment alone knows of.
ALONE = {"classify.held_cups": "filling", "classify.filled": "filling", "classify.margin": "pouring"}


def varied(variant):
    """Return the configuration with the variant's key changed."""
    changed = copy.deepcopy(config)
    key, value = VARIANTS[variant]
    if key:
        *sections, name = key.split(".")
        section = changed
        for word in sections:
            section = section[word]
        section[name] = value
    return changed


def differs(variant):
    """Return whether the variant can be told from the default with the objects that take part."""
    key, value = VARIANTS[variant]
    if key == "objects.source":
        return value in OBJECTS and value != SOURCE
    if key == "classify.training_objects":
        return value < len(OBJECTS)
    return not key or varied(variant) != config


VARIANTS = {name: of for name, of in VARIANTS.items() if differs(name)}
MOVED = {
    stage: [v for v, (key, _) in VARIANTS.items() if key.split(".")[0] in of]
    for stage, of in {"warp": ("warp", "objects"), "simulate": ("simulate",)}.items()
}
ABLATED = [
    (name, experiment)
    for name, (key, _) in VARIANTS.items()
    for experiment in EXPERIMENTS
    if ALONE.get(key, experiment) == experiment
]


wildcard_constraints:
    variant="|".join(VARIANTS),


rule ablate_labels:
    input:
        estimate=rules.label.output.labels,
        mapping=each(rules.warp.output.label, ["{object}"]),
    output:
        labels=f"{ABLATE}/adopted/{{object}}/labels.parquet",
    log:
        "logs/ablate/adopted/{object}.log",
    threads: 1
    params:
        code=code("pipeline.label.adopted"),
    shell:
        "python -m pipeline.label.adopted --estimate {input.estimate:q} --label-mapping {input.mapping:q} --labels {output.labels:q}"
        " > {log:q} 2>&1"


def source_of(variant):
    """Return the name of the variant's source."""
    key, value = VARIANTS[variant]
    return value if key == "objects.source" else SOURCE


def labels_of_source(wildcards):
    """Return the labels of the variant's source."""
    labels = rules.label if source_of(wildcards.variant) == SOURCE else rules.ablate_labels
    return labels.output.labels.format(object=source_of(wildcards.variant))


use rule warp as ablate_warp with:
    input:
        source=labels_of_source,
        target=rules.label.output.labels,
        examples=lambda w: examples(varied(w.variant)["warp"]["method"], source_of(w.variant), w.object),
    output:
        **{
            name: path.replace(f"{PROCESSED}/warp/{{source}}", f"{ABLATE}/{{variant}}/warp")
            for name, path in rules.warp.output.items()
        },
    log:
        "logs/ablate/{variant}/warp_{object}.log",
    benchmark:
        "benchmarks/ablate/{variant}/warp_{object}.tsv"
    params:
        options=lambda w: options("warp", *config["warp"], of=varied(w.variant)),
        code=code("pipeline.warp"),


use rule parametrise as ablate_parametrise with:
    input:
        point=rules.ablate_warp.output.point,
        label=rules.ablate_warp.output.label,
    output:
        parameters=f"{ABLATE}/{{variant}}/parametrise/{{object}}.parquet",
        tilt_references=f"{ABLATE}/{{variant}}/parametrise/tilt_references/{{object}}.parquet",
    log:
        "logs/ablate/{variant}/parametrise_{object}.log",
    benchmark:
        "benchmarks/ablate/{variant}/parametrise_{object}.tsv"
    params:
        source=SOURCE,
        options=rules.parametrise.params.options,
        code=rules.parametrise.params.code,


use rule simulate_pouring as ablate_pouring with:
    output:
        trials=f"{ABLATE}/{{variant}}/simulate/pouring/{{object}}/trials.parquet",
    log:
        "logs/ablate/{variant}/pouring_{object}.log",
    benchmark:
        "benchmarks/ablate/{variant}/pouring_{object}.tsv"
    params:
        shared=lambda w: options("simulate", "engine", "device", "ranges", "seed", of=varied(w.variant)),
        options=options("simulate.pouring", "fill_min", "fill_max", "tilt_max_deg", "threshold")
        + " "
        + options("ablate", "trials"),
        code=code("pipeline.simulate"),


use rule simulate_filling as ablate_filling with:
    output:
        trials=f"{ABLATE}/{{variant}}/simulate/filling/{{object}}/trials.parquet",
    log:
        "logs/ablate/{variant}/filling_{object}.log",
    benchmark:
        "benchmarks/ablate/{variant}/filling_{object}.tsv"
    params:
        held=rules.simulate_filling.params.held,
        shared=lambda w: options("simulate", "engine", "device", "ranges", "seed", of=varied(w.variant)),
        options=options(
            "simulate.filling",
            *(key for key in config["simulate"]["filling"] if key not in ("trials", "held_objects")),
        )
        + " "
        + options("ablate", "trials"),
        code=code("pipeline.simulate"),


def of_variant(stage, moved, usual):
    """Return an input function: files `moved` below ablate/<variant>, one an object, where the variant moves the stage; else `usual`."""

    def files(wildcards):
        if wildcards.variant not in MOVED[stage]:
            return [str(path).format(experiment=wildcards.experiment) for path in usual]
        pattern = f"{ABLATE}/{wildcards.variant}/{moved}"
        return [pattern.format(object=name, experiment=wildcards.experiment) for name in OBJECTS]

    return files


rule ablate:
    input:
        trials=of_variant(
            "simulate", "simulate/{experiment}/{object}/trials.parquet", rules.classify.input.trials
        ),
        parameters=of_variant(
            "warp", "parametrise/{object}.parquet", expand(rules.assemble_parameters.output, source=SOURCE)
        ),
        tilt_references=of_variant(
            "warp",
            "parametrise/tilt_references/{object}.parquet",
            expand(rules.assemble_tilt_references.output, source=SOURCE),
        ),
        meshes=lambda w: (
            each(rules.fuse.output.mesh) if varied(w.variant)["classify"]["volume"] == "cavity" else []
        ),
        clouds=lambda w: (
            each([rules.warp.output.point, rules.warp.output.label])
            if varied(w.variant)["classify"]["margin"] == "hull"
            else []
        ),
    output:
        replicates=f"{ABLATE}/{{variant}}/{{experiment}}/replicates.parquet",
        scores=f"{ABLATE}/{{variant}}/{{experiment}}/scores.parquet",
    log:
        "logs/ablate/{variant}/{experiment}.log",
    benchmark:
        "benchmarks/ablate/{variant}/{experiment}.tsv"
    threads: 1
    params:
        options=lambda w: options("classify", "samples", *CLASSIFY, "resamples", "seed", of=varied(w.variant)),
        draws=options("ablate", "draws"),
        meshes=lambda w: named(
            "meshes", rules.fuse.output.mesh, varied(w.variant)["classify"]["volume"] == "cavity"
        ),
        clouds=lambda w: named(
            "clouds",
            f"{PROCESSED}/warp/{SOURCE}/{{object}}",
            varied(w.variant)["classify"]["margin"] == "hull",
        ),
        code=code("pipeline.classify"),
    shell:
        "python -m pipeline.classify --experiment {wildcards.experiment} --trials {input.trials:q} --parameters {input.parameters:q}"
        " --tilt-references {input.tilt_references:q} --replicates {output.replicates:q} --scores {output.scores:q}"
        " {params.options} {params.draws} {params.meshes} {params.clouds} 2>&1 | tee {log:q} >&2"
