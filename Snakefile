# From scans in data/raw to reports/roc.pdf: `snakemake -c2`. Each include below is one stage, in the order of the data's way.

from snakemake.utils import min_version

min_version("9.27.1")


configfile: "config/config.yaml"


include: "workflow/rules/common.smk"


rule all:
    input:
        "reports/roc.pdf",
        "reports/metrics.json",
        "reports/labels.pdf",
        "reports/parameters.pdf",
        "reports/evaluation.pdf",
        each("reports/scans/{object}.png"),
        expand(f"{PROCESSED}/parametrise/{{source}}/parameters.parquet", source=FURTHER_SOURCES),
        "reports/index.html",
        robot_figures(),


include: "workflow/rules/compile.smk"
include: "workflow/rules/scan.smk"
include: "workflow/rules/fuse.smk"
include: "workflow/rules/label.smk"
include: "workflow/rules/warp.smk"
include: "workflow/rules/parametrise.smk"
include: "workflow/rules/simulate.smk"
include: "workflow/rules/classify.smk"
include: "workflow/rules/ablate.smk"
include: "workflow/rules/primitives.smk"
include: "workflow/rules/execute.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/track.smk"


onstart:
    shell(track_start())


onsuccess:
    shell(track_end("success", log))


onerror:
    shell(track_end("failed", log))
