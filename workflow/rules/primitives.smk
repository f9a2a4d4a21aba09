# Needs demonstrations of one pair (data/demonstrations/<name>/: pair.yaml and a CSV file a pour) and the warped parameters.
# Makes primitives/<source>/<features>/: promp.json, the distribution of pours as a feature set scales them, and demonstrations.parquet,
#       the pours themselves, scaled and aligned.
# How: probabilistic movement primitives; a prior on correlations, as pours are fewer than weights.


FEATURE_SETS = ["label_mapping", "point_mapping", "standard"]


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
