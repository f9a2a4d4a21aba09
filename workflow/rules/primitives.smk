# Needs demonstrations of one pair (data/demonstrations/<name>/: pair.yaml and a CSV file a pour) and the warped parameters.
# Makes primitives/<source>/<features>/: promp.json, the distribution of pours as a feature set scales them, and demonstrations.parquet,
#       the pours themselves, scaled and aligned.
#       primitives/<source>/conditioned/promp.json, one learnt from demonstrations with several pairs, given the pair's parameters.
# How: probabilistic movement primitives; a prior on correlations, as pours are fewer than weights.


FEATURE_SETS = ["label_mapping", "point_mapping", "standard"]
# What the scripted teacher of the stage execute shows for the conditioned primitive.
SHOWN_PAIRS = config["primitives"]["pairs"]
# All motor primitives that the robot tries.
PRIMITIVES = {
    name: f"{PROCESSED}/primitives/{SOURCE}/{name}/promp.json"
    for name in [*FEATURE_SETS, *(["conditioned"] if SHOWN_PAIRS else [])]
}


rule primitives:
    input:
        pair=os.path.join(DEMONSTRATIONS, "pair.yaml"),
        pours=[path for path in objects.files(DEMONSTRATIONS) if path.endswith(".csv")],
        parameters=rules.assemble_parameters.output[0],
        tilt_references=rules.assemble_tilt_references.output[0],
    output:
        primitive=f"{PROCESSED}/primitives/{{source}}/{{features}}/promp.json",
        trajectories=f"{PROCESSED}/primitives/{{source}}/{{features}}/demonstrations.parquet",
    log:
        "logs/primitives/{source}/{features}.log",
    wildcard_constraints:
        features="|".join(FEATURE_SETS),
    threads: 1
    params:
        folder=DEMONSTRATIONS,
        options=options("primitives", "basis", "prior_demonstrations", "samples", "seed"),
        code=code("pipeline.primitives"),
    shell:
        "python -m pipeline.primitives --demonstrations {params.folder:q} --parameters {input.parameters:q}"
        " --tilt-references {input.tilt_references:q} --features {wildcards.features} --primitive {output.primitive:q}"
        " --trajectories {output.trajectories:q} {params.options} > {log:q} 2>&1"


rule primitives_conditioned:
    input:
        pairs=[f"{PROCESSED}/execute/{pair}/demonstrations/pair.yaml" for pair in SHOWN_PAIRS],
        pours=[
            f"{PROCESSED}/execute/{pair}/demonstrations/pour_{number:02d}.csv"
            for pair in SHOWN_PAIRS
            for number in range(config["primitives"]["pours_a_pair"])
        ],
        parameters=rules.assemble_parameters.output[0],
        tilt_references=rules.assemble_tilt_references.output[0],
    output:
        primitive=f"{PROCESSED}/primitives/{{source}}/conditioned/promp.json",
    log:
        "logs/primitives/{source}/conditioned.log",
    threads: 1
    params:
        folders=" ".join(f"{PROCESSED}/execute/{pair}/demonstrations" for pair in SHOWN_PAIRS),
        options=options("primitives", "basis", "prior_demonstrations"),
        code=code("pipeline.primitives.conditioned"),
    shell:
        "python -m pipeline.primitives.conditioned --demonstrations {params.folders} --parameters {input.parameters:q}"
        " --tilt-references {input.tilt_references:q} --primitive {output.primitive:q} {params.options} > {log:q} 2>&1"
