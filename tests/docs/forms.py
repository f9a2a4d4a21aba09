"""In which form each printed command is run here, and which test runs it for real where this is a dry one."""

import re
from collections.abc import Callable
from dataclasses import dataclass

ALL = "workflow/test_dag.py::test_one_call_makes_the_figure_the_numbers_and_the_runs"
DROPPED = "workflow/test_dag.py::test_an_object_is_dropped_and_taken_away_again"
TUTORIAL = "docs/test_commands.py::test_the_tutorial_is_typed_from_its_first_line_to_its_last"
SERVER = "track/test_server.py::test_eight_write_at_once_and_nothing_is_lost"
EXECUTED = "report/test_execution.py::test_pages_are_drawn_of_any_number_of_pairs_and_sets"
# A target that Snakemake plans here: the test that makes it, or where that takes long the test of the pages' own code.
MADE_BY = {
    "": ALL,
    "reports/roc.pdf": ALL,
    "reports/metrics.json": ALL,
    "reports/labels.pdf": ALL,
    "reports/parameters.pdf": ALL,
    "reports/evaluation.pdf": ALL,
    "reports/scans/my_mug.png": DROPPED,
    "data/processed/fuse/my_mug/mesh.ply": TUTORIAL,
    "reports/promp.pdf": "primitives/test_primitives.py::test_figure_and_numbers",
    "reports/execution.pdf": EXECUTED,
    "reports/pairs.pdf": EXECUTED,
    "reports/physics.pdf": "report/test_physics.py::test_the_pages_are_the_same_bytes_for_the_same_rows",
    "reports/ablations.pdf": "report/test_evaluation.py::test_ablations_are_compared_with_the_default_replicate_by_replicate",
    "reports/sources.pdf": "report/test_sources.py::test_the_page_has_every_error_in_its_unit_and_names_who_was_annotated",
    "reports/warping.pdf": "report/test_warping.py::test_the_matrices_have_every_target_and_a_dash_where_there_is_no_number",
    "reports/watching.pdf": "report/test_watching.py::test_pages_are_drawn_of_any_number_of_pairs",
    "films": "execute/test_film.py::test_a_film_has_its_frames_and_their_time",
    'reports/metrics.json --config "warp={method: cpd}"': "warp/test_methods.py::test_labels_arrive_and_no_wall_is_crossed",
}


def looked_up(command: str) -> str:
    """Return a check that a program is there and knows the options that are used: importing what it measures takes long."""
    program, *options = command.split()[1:]
    checks = [f"grep -q '\"{option}\"' {program}" for option in options if option.startswith("--")]
    return " && ".join([f"test -f {program}", *checks])


def helped(command: str) -> str:
    """Return the command's own help, and a check that it names every option that is used."""
    words = re.split(r"\s+", re.sub(r"<\w+>", "x", command))
    program = words[: 3 if words[1] in ("-m", "models") else 2]
    options = [word for word in words[len(program) :] if re.fullmatch(r"--?[a-z][a-z-]*", word)]
    checks = "".join(f"; grep -qe '{option}' <<<\"$help\"" for option in options)
    return f'help=$({" ".join(program)} --help); test -n "$help"{checks}'


@dataclass(frozen=True)
class Form:
    """Commands that `pattern` matches wholly are typed as `typed` makes them; `real` names the test that runs them as they are."""

    pattern: str
    typed: Callable[[str], str]
    real: str | None


FORMS = (
    Form(r'(SERVER=".*" )?make mlflow-server', lambda text: text.replace("make", "make -n"), SERVER),
    Form(r"make (setup|test|all|reports/roc\.pdf)", lambda text: text.replace("make", "make -n"), ALL),
    Form(
        r"make docs",
        lambda text: text.replace("make", "make -n"),
        "docs/test_site.py::test_the_site_is_built_without_a_warning",
    ),
    Form(
        r"make track",
        lambda text: text.replace("make", "make -n"),
        "track/test_store.py::test_a_lost_store_is_told_again_with_the_same_runs",
    ),
    Form(
        r"pour annotate.*",
        helped,
        "pour/test_annotate.py::test_a_mug_painted_by_box_and_brush_is_saved_with_its_true_parts",
    ),
    Form(
        r"pour view.*",
        helped,
        "pour/test_finished.py::test_an_object_of_a_finished_run_is_viewed",
    ),
    Form(r"mlflow ui .*", helped, SERVER),
    Form(
        r"MLFLOW_TRACKING_URI=\S+ mlflow models serve .*",
        lambda text: helped(text.split(" ", 1)[1]),
        "track/test_models.py::test_it_is_served",
    ),
    Form(
        r"python benchmarks/liquid\.py.*",
        looked_up,
        "benchmarks/test_liquid.py::test_the_benchmark_of_the_liquid_runs_and_its_pour_is_true",
    ),
    # Measurements of minutes, and what installs: no test runs these as they are printed.
    Form(
        r"python benchmarks/(fusion|poses|arcs|bullet|engines|primitives|conditioned|watching|parameters|splash)\.py.*",
        looked_up,
        None,
    ),
    Form(r"python -m pipeline\.execute\.teacher", helped, None),
    Form(r"pip install .*", lambda text: text.replace("install", "install --help >/dev/null #"), None),
)


def form(command: str) -> Form | None:
    """Return the dry form of a command; None for one that is run as it is printed."""
    return next((one for one in FORMS if re.fullmatch(one.pattern, command, re.DOTALL)), None)


def planned(command: str) -> str | None:
    """Return the targets and options of a call of Snakemake other than how many cores it takes; None for other commands."""
    found = re.fullmatch(r"(?:MLFLOW_TRACKING_URI=\S+ )?snakemake\b(.*)", command)
    if not found:
        return None
    return re.sub(r"(^| )(-c\d+|-n|--rerun-incomplete)(?= |$)", "", found[1]).strip()
