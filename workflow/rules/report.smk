# Needs the curves and scores of both experiments; for the numbers also what every stage made, and the demonstration objects' truth.
# Makes report/accuracy/<object>.json, a demonstration object's errors against its truth.
# Makes reports/roc.pdf (the paper's Fig. 3) with reports/metrics.json (every headline number), and reports/labels.pdf (Fig. 2);
#       reports/scans/<object>.png, a page on each scan;
#       when asked for, reports/physics.pdf and reports/physics.json, the liquid against hydrostatics and against Bullet's spheres.
# How: one module a figure; truth is compared here and nowhere else.


rule accuracy:
    input:
        truth=rules.scan.output.truth,
        fuse=rules.fuse.output,
        label=rules.label.output.labels,
        warp=expand(rules.warp.output, source=SOURCE, allow_missing=True),
        parametrise=expand(rules.parametrise.output.parameters, source=SOURCE, allow_missing=True),
    output:
        errors=f"{PROCESSED}/report/accuracy/{{object}}.json",
    log:
        "logs/report/accuracy/{object}.log",
    threads: 1
    params:
        processed=PROCESSED,
        source=SOURCE,
        code=code("pipeline.report.accuracy"),
    shell:
        "python -m pipeline.report.accuracy --processed {params.processed:q} --source {params.source} --object {wildcards.object}"
        " --errors {output.errors:q} > {log:q} 2>&1"


rule report:
    input:
        curves=expand(rules.classify.output.curves, experiment=EXPERIMENTS),
        scores=expand(rules.classify.output.scores, experiment=EXPERIMENTS),
        predictions=expand(rules.classify.output.predictions, experiment=EXPERIMENTS),
        accuracy=each(rules.accuracy.output.errors, FOUND.demonstration),
        warp=each(list(rules.warp.output)),
        parametrise=[rules.assemble_parameters.output[0], rules.assemble_tilt_references.output[0]],
        pouring=each(rules.simulate_pouring.output.trials),
        filling=each(rules.simulate_filling.output.trials),
    output:
        roc=f"{REPORTS}/roc.pdf",
        metrics=f"{REPORTS}/metrics.json",
    log:
        "logs/report/report.log",
    benchmark:
        "benchmarks/report/report.tsv"
    threads: 1
    params:
        processed=PROCESSED,
        source=SOURCE,
        objects=" ".join(OBJECTS),
        code=code("pipeline.report.roc", "pipeline.report.metrics"),
    shell:
        "python -m pipeline.report.roc --curves {input.curves:q} --scores {input.scores:q} --output {output.roc:q} > {log:q} 2>&1\n"
        "python -m pipeline.report.metrics --processed {params.processed:q} --source {params.source} --objects {params.objects}"
        " --accuracy {input.accuracy:q} --output {output.metrics:q} >> {log:q} 2>&1"


TARGETS = [name for name in OBJECTS if name != SOURCE]


rule draw_labels:
    input:
        source=expand(rules.label.output.labels, object=SOURCE),
        initial=expand(rules.label.output.labels, object=TARGETS),
        final=each(rules.warp.output.label, TARGETS),
    output:
        figure=f"{REPORTS}/labels.pdf",
    log:
        "logs/report/labels.log",
    threads: 1
    params:
        code=code("pipeline.report.labels"),
    shell:
        "python -m pipeline.report.labels --source-labels {input.source:q} --target-labels {input.initial:q}"
        " --label-mappings {input.final:q} --output {output.figure:q} > {log:q} 2>&1"


# The other engines' tables, by engine.
OTHER_TRIALS = {
    engine: expand(
        [rules.simulate_pouring_other.output.trials, rules.simulate_filling_other.output.trials],
        object=OBJECTS,
        engine=engine,
    )
    for engine in OTHER_ENGINES
}


rule draw_scan:
    input:
        mesh=rules.fuse.output.mesh,
        cloud=rules.fuse.output.cloud,
        fusion=rules.fuse.output.report,
    output:
        page=f"{REPORTS}/scans/{{object}}.png",
    log:
        "logs/report/scans/{object}.log",
    threads: 1
    params:
        code=code("pipeline.report.scans"),
    shell:
        "python -m pipeline.report.scans --mesh {input.mesh:q} --cloud {input.cloud:q} --fusion {input.fusion:q}"
        " --output {output.page:q} > {log:q} 2>&1"


rule report_physics:
    input:
        measurements=[rules.physics_references.output[0], *each(rules.physics_object.output[0])],
        trials=[*each(rules.simulate_pouring.output.trials), *each(rules.simulate_filling.output.trials)],
        others=[path for paths in OTHER_TRIALS.values() for path in paths],
    output:
        page=f"{REPORTS}/physics.pdf",
        numbers=f"{REPORTS}/physics.json",
    log:
        "logs/report/physics.log",
    threads: 1
    params:
        options=options("simulate", "engine"),
        others=" ".join(f"{engine}={path}" for engine, paths in OTHER_TRIALS.items() for path in paths),
        code=code("pipeline.report.physics"),
    shell:
        "python -m pipeline.report.physics --measurements {input.measurements:q} --trials {input.trials:q}"
        " --other-trials {params.others} --page {output.page:q} --numbers {output.numbers:q} {params.options} > {log:q} 2>&1"


# The first pairs of the configuration are filmed.
FILMED = PAIRS[:4]


rule report_execution:
    input:
        executions=rules.assemble_executions.output.executions,
        trajectories=rules.assemble_executions.output.trajectories,
        parameters=rules.assemble_parameters.output,
        films=[rules.execute_film.output.film.format(held=held, target=target) for held, target in FILMED],
    output:
        pages=f"{REPORTS}/execution.pdf",
        film=f"{REPORTS}/execution.gif",
        numbers=f"{REPORTS}/execution.json",
    log:
        "logs/report/execution.log",
    threads: 1
    params:
        films=" ".join(f"{h}/{t}={PROCESSED}/execute/{h}/{t}/film.npz" for h, t in FILMED),
        demonstrated="/".join(DEMONSTRATED),
        code=code("pipeline.report.execution"),
    shell:
        "python -m pipeline.report.execution --executions {input.executions:q} --trajectories {input.trajectories:q}"
        " --parameters {input.parameters:q} --demonstrated {params.demonstrated} --films {params.films}"
        " --pages {output.pages:q} --film {output.film:q} --numbers {output.numbers:q} > {log:q} 2>&1"


rule report_pairs:
    input:
        executions=rules.assemble_pairs.output.executions,
    output:
        page=f"{REPORTS}/pairs.pdf",
        numbers=f"{REPORTS}/pairs.json",
    log:
        "logs/report/pairs.log",
    threads: 1
    params:
        code=code("pipeline.report.pairs"),
    shell:
        "python -m pipeline.report.pairs --executions {input.executions:q} --page {output.page:q} --numbers {output.numbers:q}"
        " > {log:q} 2>&1"
