# What the stages share: paths, the objects that take part, options from the configuration, the hash of a stage's code.
# Needs the merged configuration and data/raw; a mistake in either ends the call with one sentence.

import os
import shlex
import sys
import time

import yaml

STARTED_S = time.time()
BASE = str(workflow.basedir)
sys.path.insert(0, os.path.join(BASE, "src"))

from pipeline.errors import PipelineError
from pipeline.workflow import configuration, objects
from pipeline.workflow.code import Code

RAW = "data/raw"
PROCESSED = "data/processed"
REPORTS = "reports"
EXPERIMENTS = ["pouring", "filling"]

try:
    with open(os.path.join(BASE, "workflow/schemas/config.schema.yaml")) as file:
        schema = yaml.safe_load(file)
    config.update(configuration.typed(config, schema))
    configuration.check(config, schema)
    FOUND = objects.find(RAW, config)
    # The first source is the one that classifiers and figures take; further ones are warped and measured beside it.
    SOURCE, *FURTHER_SOURCES = objects.sources(config)
    DEMONSTRATIONS = os.path.join("data/demonstrations", config["primitives"]["demonstrations"])
    HAS_DEMONSTRATIONS = objects.demonstrated(DEMONSTRATIONS, FOUND.names)
    ANNOTATION = configuration.check_annotation("config/annotations", SOURCE)
except PipelineError as error:
    sys.exit(f"error: {error}")

OBJECTS = FOUND.names
CODE = Code(os.path.join(BASE, "src"))

# The jobs run the code that was hashed, with the Python that runs Snakemake; one thread each, so that sums are taken
# in the same order on any number of cores.
shell.prefix(
    f"set -euo pipefail; export PATH={shlex.quote(os.path.dirname(sys.executable))}:$PATH"
    f" PYTHONPATH={shlex.quote(os.path.join(BASE, 'src'))}"
    " PYTHONHASHSEED=0 OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1 MPLBACKEND=Agg; "
)


def code(*entries):
    """Return the hash of all code that `python -m` runs for the entries."""
    try:
        return CODE.hash(*entries)
    except PipelineError as error:
        sys.exit(f"error: {error}")


def options(section, *keys, of=config):
    """Return `--key value …` for the keys of a section: one text, as Snakemake compares the values of params, not their names."""
    values = of
    for name in section.split("."):
        values = values[name]
    words = {key: values[key] if isinstance(values[key], list) else [values[key]] for key in keys}
    return " ".join(f"--{key.replace('_', '-')} {' '.join(map(str, words[key]))}" for key in keys)


def each(pattern, names=OBJECTS):
    """Return `pattern` filled in for every object, source and experiment."""
    return expand(pattern, object=names, source=SOURCE)


def named(option, pattern, wanted=True):
    """Return `--option NAME=PATH …` with the path of each object when it is wanted, else nothing."""
    words = " ".join(f"{name}={path}" for name, path in zip(OBJECTS, each(pattern)))
    return f"--{option} {words}" if wanted else ""


def robot_figures():
    """Return the figures of the robot's half if there are demonstrations and both containers of their pair take part."""
    return (
        [f"{REPORTS}/{name}.pdf" for name in ("promp", "execution", "watching")] if HAS_DEMONSTRATIONS else []
    )


wildcard_constraints:
    object="|".join(OBJECTS),
    source="|".join(OBJECTS),
    experiment="|".join(EXPERIMENTS),
