# Needs both mappings of an object.
# Makes parametrise/<source>/<object>.parquet and tilt_references/<object>.parquet; uncertainties/<object>.parquet, every listed
#       parameter with its spread; then the tables of all objects, parameters.parquet, tilt_references.parquet, uncertainties.parquet.
#       For comparisons the first two below parametrise/<source>/by/<method>_k<k>/.
# How: one function a parameter, evaluated on the warped points, and on points drawn again from them for its uncertainty.


rule parametrise:
    input:
        point=rules.warp.output.point,
        label=rules.warp.output.label,
    output:
        parameters=f"{PROCESSED}/parametrise/{{source}}/{{object}}.parquet",
        tilt_references=f"{PROCESSED}/parametrise/{{source}}/tilt_references/{{object}}.parquet",
    log:
        "logs/parametrise/{source}/{object}.log",
    benchmark:
        "benchmarks/parametrise/{source}/{object}.tsv"
    threads: 1
    params:
        source="{source}",
        options=options("parametrise", "hull_points"),
        code=code("pipeline.parametrise"),
    shell:
        "python -m pipeline.parametrise --object {wildcards.object} --source {params.source}"
        " --point-mapping {input.point:q} --label-mapping {input.label:q}"
        " --parameters {output.parameters:q} --tilt-references {output.tilt_references:q} {params.options} > {log:q} 2>&1"


PARAMETRISE_BY = f"{PROCESSED}/parametrise/{{source}}/by/{{method}}_k{{k}}"


use rule parametrise as parametrise_by with:
    input:
        point=rules.warp_by.output.point,
        label=rules.warp_by.output.label,
    output:
        parameters=f"{PARAMETRISE_BY}/{{object}}.parquet",
        tilt_references=f"{PARAMETRISE_BY}/tilt_references/{{object}}.parquet",
    log:
        "logs/parametrise/{source}/by/{method}_k{k}/{object}.log",
    benchmark:
        "benchmarks/parametrise/{source}/by/{method}_k{k}/{object}.tsv"
    params:
        source="{source}",
        # Rigidly warped, a mug leaves a wide bowl without a rim: the comparison says so.
        options=options("parametrise", "hull_points") + " --allow-missing",
        code=code("pipeline.parametrise"),


rule uncertainties:
    input:
        point=rules.warp.output.point,
        label=rules.warp.output.label,
    output:
        uncertainties=f"{PROCESSED}/parametrise/{{source}}/uncertainties/{{object}}.parquet",
    log:
        "logs/parametrise/uncertainties/{source}/{object}.log",
    benchmark:
        "benchmarks/parametrise/uncertainties/{source}/{object}.tsv"
    threads: 1
    params:
        options=options("parametrise", "parameters", "hull_points", "redraws", "seed"),
        code=code("pipeline.parametrise.uncertainty"),
    shell:
        "python -m pipeline.parametrise.uncertainty --object {wildcards.object} --point-mapping {input.point:q}"
        " --label-mapping {input.label:q} --uncertainties {output.uncertainties:q} {params.options} > {log:q} 2>&1"


rule assemble_parameters:
    input:
        expand(rules.parametrise.output.parameters, object=OBJECTS, allow_missing=True),
    output:
        f"{PROCESSED}/parametrise/{{source}}/parameters.parquet",
    log:
        "logs/parametrise/{source}/parameters.log",
    threads: 1
    params:
        code=code("pipeline.parametrise.assemble"),
    shell:
        "python -m pipeline.parametrise.assemble --tables {input:q} --table parameters --output {output:q} > {log:q} 2>&1"


rule assemble_tilt_references:
    input:
        expand(rules.parametrise.output.tilt_references, object=OBJECTS, allow_missing=True),
    output:
        f"{PROCESSED}/parametrise/{{source}}/tilt_references.parquet",
    log:
        "logs/parametrise/{source}/tilt_references.log",
    threads: 1
    params:
        code=code("pipeline.parametrise.assemble"),
    shell:
        "python -m pipeline.parametrise.assemble --tables {input:q} --table tilt_references --output {output:q} > {log:q} 2>&1"


rule assemble_uncertainties:
    input:
        each(rules.uncertainties.output.uncertainties),
    output:
        f"{PROCESSED}/parametrise/{SOURCE}/uncertainties.parquet",
    log:
        "logs/parametrise/uncertainties.log",
    threads: 1
    params:
        code=code("pipeline.parametrise.assemble"),
    shell:
        "python -m pipeline.parametrise.assemble --tables {input:q} --table uncertainties --output {output:q} > {log:q} 2>&1"
