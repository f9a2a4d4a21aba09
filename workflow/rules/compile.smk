# Needs nothing.
# Makes compile/<stage>.json, the names of the compiled functions; their machine code is cached beside the package.
# How: once before a stage's first jobs, which would each compile the same at the same time. After an edit they do so themselves.


rule compile:
    output:
        compiled=f"{PROCESSED}/compile/{{stage}}.json",
    log:
        "logs/compile/{stage}.log",
    benchmark:
        "benchmarks/compile/{stage}.tsv"
    wildcard_constraints:
        stage="fuse|simulate",
    priority: 3
    threads: 1
    shell:
        "python -m pipeline.compile {wildcards.stage} --compiled {output.compiled:q} 2>&1 | tee {log:q} >&2"


def compiled(stage):
    """Return what tells that a stage's functions are compiled; a file that is touched or copied reruns nothing.

    Not ancient(): when such a file is to be made again, Snakemake 9.27 makes it and forgets all that waits for it; without it, that runs, too.
    """
    return expand(rules.compile.output.compiled, stage=stage)
