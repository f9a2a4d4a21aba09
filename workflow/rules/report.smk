# Needs the curves and scores of both experiments; for the numbers also what every stage made, and the demonstration objects' truth.
# Makes report/accuracy/<object>.json, a demonstration object's errors against its truth.
# Makes reports/roc.pdf (the paper's Fig. 3) with reports/metrics.json (every headline number), and reports/labels.pdf (Fig. 2);
#       reports/parameters.pdf, every parameter on its object and against known values, and reports/parameters.json, volumes side by side;
#       reports/scans/<object>.png, a page on each scan; reports/index.html, all of this on one page for a browser;
#       when asked for, reports/sources.pdf and .json, every demonstration object as the source for every other;
#       when asked for, reports/warping.pdf and .json, every method of warping on every demonstration object;
#       reports/evaluation.pdf and .json, how sure the scores are and what that says of the paper's claims;
#       when asked for, reports/ablations.pdf and .json, the scores with one key changed at a time;
#       reports/promp.pdf (Fig. 4) with reports/promp.json, where there are demonstrations of a pour;
#       reports/execution.pdf (Fig. 5), execution.gif and execution.json, what the robot poured, where there are demonstrations;
#       reports/watching.pdf and .json, what the classifiers say along these executions;
#       when asked for, reports/pairs.pdf and .json, every object into every other, with the liquid;
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
        " --errors {output.errors:q} 2>&1 | tee {log:q} >&2"


rule report:
    input:
        curves=expand(rules.classify.output.curves, experiment=EXPERIMENTS),
        scores=expand(rules.classify.output.scores, experiment=EXPERIMENTS),
        predictions=expand(rules.classify.output.predictions, experiment=EXPERIMENTS),
        accuracy=each(rules.accuracy.output.errors, FOUND.demonstration),
        warp=each(list(rules.warp.output)),
        parametrise=expand(
            [*rules.assemble_parameters.output, *rules.assemble_tilt_references.output], source=SOURCE
        ),
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


rule report_evaluation:
    input:
        replicates=expand(rules.classify.output.replicates, experiment=EXPERIMENTS),
        pairs=expand(rules.classify.output.pairs, experiment=EXPERIMENTS),
        learning=expand(rules.classify_learning.output.learning, experiment=EXPERIMENTS),
        scores=expand(rules.classify.output.scores, experiment=EXPERIMENTS),
        predictions=expand(rules.classify.output.predictions, experiment=EXPERIMENTS),
        fillings=each(rules.simulate_filling.output.trials),
    output:
        page=f"{REPORTS}/evaluation.pdf",
        numbers=f"{REPORTS}/evaluation.json",
    log:
        "logs/report/evaluation.log",
    benchmark:
        "benchmarks/report/evaluation.tsv"
    threads: 1
    params:
        options=options("classify", "resamples", "seed"),
        code=code("pipeline.report.evaluation"),
    shell:
        "python -m pipeline.report.evaluation --replicates {input.replicates:q} --pairs {input.pairs:q} --learning {input.learning:q}"
        " --scores {input.scores:q} --predictions {input.predictions:q} --fillings {input.fillings:q} --page {output.page:q}"
        " --numbers {output.numbers:q} {params.options} 2>&1 | tee {log:q} >&2"


rule report_ablations:
    input:
        replicates=[
            path.format(variant=variant, experiment=experiment)
            for path in [rules.ablate.output.replicates]
            for variant, experiment in ABLATED
        ],
        scores=[
            path.format(variant=variant, experiment=experiment)
            for path in [rules.ablate.output.scores]
            for variant, experiment in ABLATED
        ],
    output:
        page=f"{REPORTS}/ablations.pdf",
        numbers=f"{REPORTS}/ablations.json",
    log:
        "logs/report/ablations.log",
    threads: 1
    params:
        variants=" ".join(f"{variant}={key}:{value}" for variant, (key, value) in VARIANTS.items()),
        trials=options("ablate", "trials", "draws"),
        code=code("pipeline.report.ablations"),
    shell:
        "python -m pipeline.report.ablations --replicates {input.replicates:q} --scores {input.scores:q} --variants {params.variants}"
        " {params.trials} --page {output.page:q} --numbers {output.numbers:q} > {log:q} 2>&1"


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


rule draw_parameters:
    input:
        uncertainties=rules.assemble_uncertainties.output[0],
        mappings=each(rules.warp.output.label),
        containers=each(rules.simulate_container.output.container),
        accuracy=each(rules.accuracy.output.errors, FOUND.demonstration),
    output:
        page=f"{REPORTS}/parameters.pdf",
        numbers=f"{REPORTS}/parameters.json",
    log:
        "logs/report/parameters.log",
    threads: 1
    params:
        code=code("pipeline.report.parameters"),
    shell:
        "python -m pipeline.report.parameters --uncertainties {input.uncertainties:q} --label-mappings {input.mappings:q}"
        " --containers {input.containers:q} --accuracy {input.accuracy:q} --page {output.page:q} --numbers {output.numbers:q}"
        " > {log:q} 2>&1"


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
        " --output {output.page:q} 2>&1 | tee {log:q} >&2"


rule report_primitives:
    input:
        primitives=expand(rules.primitives.output.primitive, source=SOURCE, features=FEATURE_SETS),
        trajectories=expand(rules.primitives.output.trajectories, source=SOURCE, features=FEATURE_SETS),
        conditioned=[PRIMITIVES["conditioned"]] if SHOWN_PAIRS else [],
        parameters=expand(rules.assemble_parameters.output, source=SOURCE),
    output:
        pages=f"{REPORTS}/promp.pdf",
        numbers=f"{REPORTS}/promp.json",
    log:
        "logs/report/promp.log",
    threads: 1
    params:
        options=options("primitives", "prior_demonstrations"),
        # The first pairs that are executed.
        conditioned=(
            f"--conditioned {PRIMITIVES['conditioned']} --pairs {' '.join(config['execute']['pairs'][:4])}"
            if SHOWN_PAIRS
            else ""
        ),
        code=code("pipeline.report.primitives"),
    shell:
        "python -m pipeline.report.primitives --primitives {input.primitives:q} --trajectories {input.trajectories:q}"
        " --pages {output.pages:q} --numbers {output.numbers:q} {params.options} --parameters {input.parameters:q} {params.conditioned}"
        " 2>&1 | tee {log:q} >&2"


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


# Neighbours of the label mapping over which parameters spread, beside the configured number.
SPREAD_OVER_K = sorted({1, 5, 20, config["warp"]["k"]})


rule report_sources:
    input:
        by_k=expand(
            rules.parametrise_by.output.parameters,
            source=SOURCE,
            method=config["warp"]["method"],
            k=SPREAD_OVER_K,
            object=FOUND.demonstration,
        ),
        uncertainties=expand(
            rules.uncertainties.output.uncertainties, source=SOURCE, object=FOUND.demonstration
        ),
        truth=expand(rules.scan.output.truth, object=FOUND.demonstration),
        fuse=expand(rules.fuse.output, object=FOUND.demonstration),
        warp=expand(rules.warp.output.label, source=FOUND.demonstration, object=FOUND.demonstration),
        parametrise=expand(
            rules.parametrise.output.parameters, source=FOUND.demonstration, object=FOUND.demonstration
        ),
    output:
        page=f"{REPORTS}/sources.pdf",
        numbers=f"{REPORTS}/sources.json",
    log:
        "logs/report/sources.log",
    threads: 1
    params:
        processed=PROCESSED,
        source=SOURCE,
        objects=" ".join(FOUND.demonstration),
        by_k=" ".join(f"{config['warp']['method']}_k{k}" for k in SPREAD_OVER_K),
        adopted=" ".join(name for name in FOUND.demonstration if annotation_of(name).startswith(PROCESSED)),
        code=code("pipeline.report.sources"),
    shell:
        "python -m pipeline.report.sources --processed {params.processed:q} --source {params.source} --objects {params.objects}"
        " --adopted {params.adopted} --by-k {params.by_k} --page {output.page:q} --numbers {output.numbers:q} > {log:q} 2>&1"


rule report_warping:
    input:
        truth=expand(rules.scan.output.truth, object=FOUND.demonstration),
        fuse=expand(rules.fuse.output, object=FOUND.demonstration),
        warp=expand(
            rules.warp_by.output,
            source=SOURCE,
            method=METHODS,
            k=config["warp"]["k"],
            object=[name for name in FOUND.demonstration if name != SOURCE],
        ),
        parametrise=expand(
            rules.parametrise_by.output.parameters,
            source=SOURCE,
            method=METHODS,
            k=config["warp"]["k"],
            object=[name for name in FOUND.demonstration if name != SOURCE],
        ),
    output:
        page=f"{REPORTS}/warping.pdf",
        numbers=f"{REPORTS}/warping.json",
    log:
        "logs/report/warping.log",
    threads: 1
    params:
        processed=PROCESSED,
        source=SOURCE,
        targets=" ".join(name for name in FOUND.demonstration if name != SOURCE),
        methods=" ".join(METHODS),
        k=options("warp", "k"),
        code=code("pipeline.report.warping"),
    shell:
        "python -m pipeline.report.warping --processed {params.processed:q} --source {params.source} --targets {params.targets}"
        " --methods {params.methods} {params.k} --page {output.page:q} --numbers {output.numbers:q} > {log:q} 2>&1"


# The first pairs of the configuration are filmed.
FILMED = PAIRS[:4]


rule report_execution:
    input:
        executions=rules.assemble_executions.output.executions,
        trajectories=rules.assemble_executions.output.trajectories,
        safety=rules.execute_safety.output.safety,
        pair=os.path.join(DEMONSTRATIONS, "pair.yaml"),
        parameters=expand(rules.assemble_parameters.output, source=SOURCE),
        films=[
            rules.execute_film.output.film.format(held=held, target=target, features="label_mapping")
            for held, target in FILMED
        ],
    output:
        pages=f"{REPORTS}/execution.pdf",
        film=f"{REPORTS}/execution.gif",
        numbers=f"{REPORTS}/execution.json",
    log:
        "logs/report/execution.log",
    threads: 1
    params:
        films=" ".join(f"{h}/{t}={PROCESSED}/execute/{h}/{t}/label_mapping/film.npz" for h, t in FILMED),
        code=code("pipeline.report.execution"),
    shell:
        "python -m pipeline.report.execution --executions {input.executions:q} --trajectories {input.trajectories:q}"
        " --parameters {input.parameters:q} --safety {input.safety:q} --demonstration {input.pair:q} --films {params.films}"
        " --pages {output.pages:q} --film {output.film:q} --numbers {output.numbers:q} 2>&1 | tee {log:q} >&2"


rule report_watching:
    input:
        pouring=f"{PROCESSED}/classify/pouring/models.json",
        filling=f"{PROCESSED}/classify/filling/models.json",
        parameters=expand(rules.assemble_parameters.output, source=SOURCE),
        trajectories=rules.assemble_executions.output.trajectories,
        balls=of_pairs(rules.execute_balls.output.outcomes),
        liquid=of_pairs(rules.execute_liquid.output.outcomes),
    output:
        pages=f"{REPORTS}/watching.pdf",
        numbers=f"{REPORTS}/watching.json",
    log:
        "logs/report/watching.log",
    threads: 1
    params:
        fill=options("execute", "fill"),
        filling=options("simulate.filling", "held_particles", "tilt_deg"),
        spacing=options("simulate", "spacing_m"),
        code=code("pipeline.report.watching"),
    shell:
        "python -m pipeline.report.watching --source {SOURCE} --pouring {input.pouring:q} --filling {input.filling:q}"
        " --parameters {input.parameters:q} --trajectories {input.trajectories:q} --balls {input.balls:q} --liquid {input.liquid:q}"
        " --pages {output.pages:q} --numbers {output.numbers:q} {params.fill} {params.filling} {params.spacing} 2>&1 | tee {log:q} >&2"


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


# What index.html shows: a line each for a figure (its words are in pipeline.report.index.figures) and for its numbers.
INDEX_FIGURES = [
    rules.report.output.roc,
    rules.report_evaluation.output.page,
    rules.draw_labels.output.figure,
    rules.draw_parameters.output.page,
    *robot_figures(),
]
INDEX_NUMBERS = [
    rules.report.output.metrics,
    rules.report_evaluation.output.numbers,
    *([rules.report_execution.output.numbers] if HAS_DEMONSTRATIONS else []),
]


rule index:
    input:
        figures=INDEX_FIGURES,
        numbers=INDEX_NUMBERS,
        scans=each(rules.draw_scan.output.page),
        mesh=each(rules.fuse.output.mesh),
        fusion=each(rules.fuse.output.report),
        labels=each(rules.warp.output.label),
        containers=each(rules.simulate_container.output.container),
        parameters=expand(rules.assemble_parameters.output, source=SOURCE)[0],
        uncertainties=rules.assemble_uncertainties.output[0],
    output:
        page=f"{REPORTS}/index.html",
    log:
        "logs/report/index.log",
    threads: 1
    params:
        processed=PROCESSED,
        source=SOURCE,
        objects=" ".join(OBJECTS),
        simulate=options("simulate", "engine", "spacing_m"),
        classify=options("classify", "samples", "draws"),
        code=code("pipeline.report.index"),
    shell:
        "python -m pipeline.report.index --processed {params.processed:q} --source {params.source} --objects {params.objects}"
        " --numbers {input.numbers:q} --figures {input.figures:q} --scans {input.scans:q} {params.simulate} {params.classify}"
        " --uncertainties {input.uncertainties:q} --output {output.page:q} 2>&1 | tee {log:q} >&2"
