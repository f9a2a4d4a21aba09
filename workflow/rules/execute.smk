# Needs the motor primitives, warped parameters, the prepared containers.
# Makes execute/<held>/<target>/demonstrations/, what the scripted teacher shows for the conditioned primitive.
# Makes execute/<held>/<target>/: attempts.parquet and trajectories.parquet (what the arm could and did), outcomes.parquet (what was
#       poured on the way); of all pairs executions.parquet, trajectories.parquet, safety.parquet. When asked for, films of executions, and
#       demonstrations/, the ten pours that data/demonstrations/tall_cup_wide_bowl is a copy of.
# How: inverse kinematics and motors in Bullet; simulate carries gel balls along the poses that the arm has done.

# In the order of the configuration.
PAIRS = [pair.split("/") for pair in config["execute"]["pairs"]]
# What the scripted teacher pours.
DEMONSTRATED = ["tall_cup", "wide_bowl"]
NAMED_PRIMITIVES = " ".join(f"{name}={path}" for name, path in PRIMITIVES.items())


wildcard_constraints:
    held="|".join(OBJECTS),
    target="|".join(OBJECTS),


def of_pairs(pattern):
    """Return `pattern` filled in for every pair of the configuration."""
    return [pattern.format(held=held, target=target) for held, target in PAIRS]


def container_of(role):
    """Return the container of the object that a pair's wildcard names."""
    return lambda wildcards: rules.simulate_container.output.container.format(object=wildcards[role])


rule execute:
    input:
        held=container_of("held"),
        target=container_of("target"),
        parameters=expand(rules.assemble_parameters.output, source=SOURCE),
        primitives=list(PRIMITIVES.values()),
        pair=os.path.join(DEMONSTRATIONS, "pair.yaml"),
    output:
        attempts=f"{PROCESSED}/execute/{{held}}/{{target}}/attempts.parquet",
        trajectories=f"{PROCESSED}/execute/{{held}}/{{target}}/trajectories.parquet",
    log:
        "logs/execute/{held}/{target}/arm.log",
    benchmark:
        "benchmarks/execute/{held}/{target}/arm.tsv"
    threads: 1
    params:
        primitives=NAMED_PRIMITIVES,
        options=options("execute", "draws", "attempts", "seed"),
        code=code("pipeline.execute"),
    shell:
        "python -m pipeline.execute --held {wildcards.held}={input.held:q} --target {wildcards.target}={input.target:q}"
        " --parameters {input.parameters:q} --primitives {params.primitives} --demonstration {input.pair:q}"
        " --attempts-table {output.attempts:q} --trajectories {output.trajectories:q} {params.options} 2>&1 | tee {log:q} >&2"


rule execute_balls:
    input:
        held=container_of("held"),
        target=container_of("target"),
        trajectories=rules.execute.output.trajectories,
    output:
        outcomes=f"{PROCESSED}/execute/{{held}}/{{target}}/outcomes.parquet",
    log:
        "logs/execute/{held}/{target}/balls.log",
    benchmark:
        "benchmarks/execute/{held}/{target}/balls.tsv"
    threads: 1
    params:
        options=options("execute", "fill", "balls", "seed"),
        code=code("pipeline.simulate.carry"),
    shell:
        "python -m pipeline.simulate.carry --held {wildcards.held}={input.held:q} --target {wildcards.target}={input.target:q}"
        " --trajectories {input.trajectories:q} --outcomes {output.outcomes:q} {params.options} 2>&1 | tee {log:q} >&2"


rule assemble_executions:
    input:
        attempts=of_pairs(rules.execute.output.attempts),
        outcomes=of_pairs(rules.execute_balls.output.outcomes),
        trajectories=of_pairs(rules.execute.output.trajectories),
        parameters=expand(rules.assemble_parameters.output, source=SOURCE),
    output:
        executions=f"{PROCESSED}/execute/executions.parquet",
        trajectories=f"{PROCESSED}/execute/trajectories.parquet",
    log:
        "logs/execute/executions.log",
    threads: 1
    params:
        options=options("execute", "fill"),
        code=code("pipeline.execute.assemble"),
    shell:
        "python -m pipeline.execute.assemble --source {SOURCE} --attempts {input.attempts:q} --outcomes {input.outcomes:q}"
        " --trajectory-tables {input.trajectories:q} --parameters {input.parameters:q} --executions {output.executions:q}"
        " --trajectories {output.trajectories:q} {params.options} > {log:q} 2>&1"


rule execute_safety:
    input:
        containers=each(rules.simulate_container.output.container),
        parameters=expand(rules.assemble_parameters.output, source=SOURCE),
        primitives=list(PRIMITIVES.values()),
        pair=os.path.join(DEMONSTRATIONS, "pair.yaml"),
    output:
        safety=f"{PROCESSED}/execute/safety.parquet",
    log:
        "logs/execute/safety.log",
    threads: 1
    params:
        pairs=" ".join(config["execute"]["pairs"]),
        containers=named("containers", rules.simulate_container.output.container),
        primitives=NAMED_PRIMITIVES,
        samples=options("primitives", "samples"),
        seed=options("execute", "seed"),
        code=code("pipeline.execute.safety"),
    shell:
        "python -m pipeline.execute.safety --pairs {params.pairs} {params.containers} --parameters {input.parameters:q}"
        " --primitives {params.primitives} --demonstration {input.pair:q} --safety {output.safety:q} {params.samples} {params.seed}"
        " 2>&1 | tee {log:q} >&2"


rule execute_film_balls:
    input:
        held=container_of("held"),
        target=container_of("target"),
        trajectories=rules.execute.output.trajectories,
    output:
        film=f"{PROCESSED}/execute/{{held}}/{{target}}/{{features}}/balls.npz",
    log:
        "logs/execute/{held}/{target}/{features}/film_balls.log",
    benchmark:
        "benchmarks/execute/{held}/{target}/{features}/film_balls.tsv"
    wildcard_constraints:
        features="|".join(PRIMITIVES),
    threads: 1
    params:
        options=options("execute", "fill", "balls", "seed"),
        code=code("pipeline.simulate.filmed"),
    shell:
        "python -m pipeline.simulate.filmed --held {wildcards.held}={input.held:q} --target {wildcards.target}={input.target:q}"
        " --trajectories {input.trajectories:q} --features {wildcards.features} --film {output.film:q} {params.options} > {log:q} 2>&1"


rule execute_film:
    input:
        held=container_of("held"),
        target=container_of("target"),
        trajectories=rules.execute.output.trajectories,
        balls=rules.execute_film_balls.output.film,
    output:
        film=f"{PROCESSED}/execute/{{held}}/{{target}}/{{features}}/film.npz",
        gif=f"{PROCESSED}/execute/{{held}}/{{target}}/{{features}}/film.gif",
    log:
        "logs/execute/{held}/{target}/{features}/film.log",
    benchmark:
        "benchmarks/execute/{held}/{target}/{features}/film.tsv"
    wildcard_constraints:
        features="|".join(PRIMITIVES),
    threads: 1
    params:
        code=code("pipeline.execute.film"),
    shell:
        "python -m pipeline.execute.film --held {wildcards.held}={input.held:q} --target {wildcards.target}={input.target:q}"
        " --trajectories {input.trajectories:q} --balls-film {input.balls:q}"
        " --features {wildcards.features} --film {output.film:q} --gif {output.gif:q} 2>&1 | tee {log:q} >&2"


rule demonstrate:
    input:
        held=rules.simulate_container.output.container.format(object=DEMONSTRATED[0]),
        target=rules.simulate_container.output.container.format(object=DEMONSTRATED[1]),
    output:
        pours=[f"{PROCESSED}/execute/demonstrations/pour_{number:02d}.csv" for number in range(10)],
        pair=f"{PROCESSED}/execute/demonstrations/pair.yaml",
    log:
        "logs/execute/demonstrations.log",
    threads: 1
    params:
        code=code("pipeline.execute.teacher"),
    shell:
        "python -m pipeline.execute.teacher --held {DEMONSTRATED[0]}={input.held:q} --target {DEMONSTRATED[1]}={input.target:q}"
        " --output $(dirname {output.pair:q}) > {log:q} 2>&1"


rule demonstrate_pair:
    input:
        held=container_of("held"),
        target=container_of("target"),
    output:
        pours=[
            f"{PROCESSED}/execute/{{held}}/{{target}}/demonstrations/pour_{number:02d}.csv"
            for number in range(config["primitives"]["pours_a_pair"])
        ],
        pair=f"{PROCESSED}/execute/{{held}}/{{target}}/demonstrations/pair.yaml",
    log:
        "logs/execute/{held}/{target}/demonstrations.log",
    threads: 1
    params:
        pours=config["primitives"]["pours_a_pair"],
        code=code("pipeline.execute.teacher"),
    shell:
        "python -m pipeline.execute.teacher --held {wildcards.held}={input.held:q} --target {wildcards.target}={input.target:q}"
        " --sees-the-pair --pours {params.pours} --output $(dirname {output.pair:q}) > {log:q} 2>&1"


rule films:
    input:
        [
            rules.execute_film.output.gif.format(held=held, target=target, features=features)
            for held, target in PAIRS
            for features in PRIMITIVES
        ],


# Every object into every other, when reports/pairs.pdf is asked for.
ALL_PAIRS = [(held, target) for held in OBJECTS for target in OBJECTS if held != target]


rule execute_liquid:
    input:
        held=container_of("held"),
        target=container_of("target"),
        trajectories=rules.execute.output.trajectories,
    output:
        outcomes=f"{PROCESSED}/execute/{{held}}/{{target}}/liquid.parquet",
    log:
        "logs/execute/{held}/{target}/liquid.log",
    benchmark:
        "benchmarks/execute/{held}/{target}/liquid.tsv"
    threads: 1
    params:
        options=options("execute", "fill", "seed"),
        code=code("pipeline.simulate.carry"),
    shell:
        "python -m pipeline.simulate.carry --held {wildcards.held}={input.held:q} --target {wildcards.target}={input.target:q}"
        " --contents liquid --trajectories {input.trajectories:q} --outcomes {output.outcomes:q} {params.options} > {log:q} 2>&1"


rule assemble_pairs:
    input:
        attempts=[rules.execute.output.attempts.format(held=h, target=t) for h, t in ALL_PAIRS],
        outcomes=[rules.execute_liquid.output.outcomes.format(held=h, target=t) for h, t in ALL_PAIRS],
        parameters=expand(rules.assemble_parameters.output, source=SOURCE),
    output:
        executions=f"{PROCESSED}/execute/pairs.parquet",
    log:
        "logs/execute/pairs.log",
    threads: 1
    params:
        options=options("execute", "fill"),
        code=code("pipeline.execute.assemble"),
    shell:
        "python -m pipeline.execute.assemble --liquid --source {SOURCE} --attempts {input.attempts:q} --outcomes {input.outcomes:q}"
        " --parameters {input.parameters:q} --executions {output.executions:q} {params.options} > {log:q} 2>&1"
