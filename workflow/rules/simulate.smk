# Needs the fused meshes.
# Makes simulate/containers/<object>.npz: the object made ready for trials; simulate/<experiment>/<object>/trials.parquet: what was poured,
#       and what happened; for the page on the liquid's physics also simulate/physics/: the liquid measured in vessels of known shape and
#       in each object.
# How: Bullet moves the containers and finds collisions, particles are the liquid. Progress goes to the terminal and to the log.

HELD = config["simulate"]["filling"]["held_objects"]
# The pages on physics compare: the first trials of each object are run by the engines that the others are not run by.
ENGINES = ["liquid", "bullet", "bullet_fluid"]
OTHER_ENGINES = [name for name in ENGINES if name != config["simulate"]["engine"]]


wildcard_constraints:
    engine="|".join(ENGINES),


rule simulate_container:
    input:
        mesh=rules.fuse.output.mesh,
        compiled=compiled("simulate"),
    output:
        container=f"{PROCESSED}/simulate/containers/{{object}}.npz",
    log:
        "logs/simulate/containers/{object}.log",
    benchmark:
        "benchmarks/simulate/containers/{object}.tsv"
    threads: 1
    params:
        options=options("simulate", "spacing_m"),
        code=code("pipeline.simulate.prepared"),
    shell:
        "python -m pipeline.simulate prepare --object {wildcards.object} --mesh {input.mesh:q} --container {output.container:q}"
        " {params.options} 2>&1 | tee {log:q} >&2"


rule simulate_pouring:
    input:
        container=rules.simulate_container.output.container,
    output:
        trials=f"{PROCESSED}/simulate/pouring/{{object}}/trials.parquet",
    log:
        "logs/simulate/pouring/{object}.log",
    benchmark:
        "benchmarks/simulate/pouring/{object}.tsv"
    # The longest jobs begin as soon as they can: what is short fills the gaps that they leave.
    priority: 2
    threads: 1
    params:
        shared=options("simulate", "engine", "device", "ranges", "seed"),
        options=options("simulate.pouring", "trials", "fill_min", "fill_max", "tilt_max_deg", "threshold"),
        code=code("pipeline.simulate"),
    shell:
        "python -m pipeline.simulate pouring --object {wildcards.object} --container {input.container:q} --trials-table {output.trials:q}"
        " {params.shared} {params.options} 2>&1 | tee {log:q} >&2"


rule simulate_filling:
    input:
        container=rules.simulate_container.output.container,
        held=expand(rules.simulate_container.output.container, object=HELD),
    output:
        trials=f"{PROCESSED}/simulate/filling/{{object}}/trials.parquet",
    log:
        "logs/simulate/filling/{object}.log",
    benchmark:
        "benchmarks/simulate/filling/{object}.tsv"
    priority: 1
    threads: 1
    params:
        # The order of the cups decides which one a trial draws.
        held=" ".join(f"{name}={PROCESSED}/simulate/containers/{name}.npz" for name in HELD),
        shared=options("simulate", "engine", "device", "ranges", "seed"),
        options=options(
            "simulate.filling",
            "trials",
            "held_particles",
            "tilt_deg",
            "offset_max_radii",
            "height_min",
            "height_max",
            "free_room_max_particles",
        ),
        code=code("pipeline.simulate"),
    shell:
        "python -m pipeline.simulate filling --object {wildcards.object} --container {input.container:q} --held {params.held}"
        " --trials-table {output.trials:q} {params.shared} {params.options} 2>&1 | tee {log:q} >&2"


rule physics_references:
    output:
        measurements=f"{PROCESSED}/simulate/physics/references.parquet",
    log:
        "logs/simulate/physics/references.log",
    benchmark:
        "benchmarks/simulate/physics/references.tsv"
    threads: 1
    params:
        shared=options("simulate", "spacing_m", "seed"),
        code=code("pipeline.simulate.physics"),
    shell:
        "python -m pipeline.simulate.physics references --measurements {output.measurements:q} {params.shared} > {log:q} 2>&1"


rule physics_object:
    input:
        mesh=rules.fuse.output.mesh,
        pouring=rules.simulate_pouring.output.trials,
        filling=rules.simulate_filling.output.trials,
        held=expand(rules.fuse.output.mesh, object=HELD),
    output:
        measurements=f"{PROCESSED}/simulate/physics/{{object}}/measurements.parquet",
    log:
        "logs/simulate/physics/{object}.log",
    benchmark:
        "benchmarks/simulate/physics/{object}.tsv"
    threads: 1
    params:
        held=" ".join(f"{name}={PROCESSED}/fuse/{name}/mesh.ply" for name in HELD),
        shared=options("simulate", "spacing_m", "seed"),
        threshold=options("simulate.pouring", "threshold"),
        options=options("simulate.physics", "convergence_trials"),
        code=code("pipeline.simulate.physics"),
    shell:
        "python -m pipeline.simulate.physics object --object {wildcards.object} --mesh {input.mesh:q} --pouring {input.pouring:q}"
        " --filling {input.filling:q} --held {params.held} --measurements {output.measurements:q} {params.shared} {params.threshold}"
        " {params.options} 2>&1 | tee {log:q} >&2"


use rule simulate_pouring as simulate_pouring_other with:
    output:
        trials=f"{PROCESSED}/simulate/physics/{{object}}/{{engine}}/pouring.parquet",
    log:
        "logs/simulate/physics/{object}_{engine}_pouring.log",
    benchmark:
        "benchmarks/simulate/physics/{object}_{engine}_pouring.tsv"
    params:
        shared=options("simulate", "ranges", "seed") + " --engine {engine}",
        options=options("simulate.pouring", "fill_min", "fill_max", "tilt_max_deg", "threshold")
        + f" --trials {config['simulate']['physics']['engine_pours']}",
        code=code("pipeline.simulate"),


use rule simulate_filling as simulate_filling_other with:
    output:
        trials=f"{PROCESSED}/simulate/physics/{{object}}/{{engine}}/filling.parquet",
    log:
        "logs/simulate/physics/{object}_{engine}_filling.log",
    benchmark:
        "benchmarks/simulate/physics/{object}_{engine}_filling.tsv"
    params:
        held=rules.simulate_filling.params.held,
        shared=options("simulate", "ranges", "seed") + " --engine {engine}",
        options=options(
            "simulate.filling",
            "held_particles",
            "tilt_deg",
            "offset_max_radii",
            "height_min",
            "height_max",
            "free_room_max_particles",
        )
        + f" --trials {config['simulate']['physics']['engine_fillings']}",
        code=code("pipeline.simulate"),
