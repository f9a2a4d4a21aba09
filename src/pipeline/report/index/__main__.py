"""Write reports/index.html: what was run, its numbers and figures, every object in three dimensions; needs no network."""

from collections.abc import Sequence
from pathlib import Path

from pipeline import command
from pipeline.artefacts import read_json, replacing


def main() -> None:
    """Read figures, numbers and what the stages made of each object; write the page."""
    parser = command.parser(__doc__)
    parser.add_argument("--processed", type=Path, required=True, help="folder of the stages' artefacts")
    parser.add_argument("--source", required=True, help="name of the annotated object")
    parser.add_argument("--objects", nargs="+", required=True, help="names of all objects that take part")
    parser.add_argument(
        "--numbers", type=Path, nargs="+", required=True, help="metrics.json, evaluation.json, execution.json"
    )
    parser.add_argument("--figures", type=Path, nargs="*", default=[], help="PDF files, in the page's order")
    parser.add_argument("--scans", type=Path, nargs="*", default=[], help="pages on the objects' scans, PNG")
    parser.add_argument("--uncertainties", type=Path, help="table of the parameters' uncertainties")
    for option in ("engine", "spacing-m", "samples", "draws"):
        parser.add_argument(f"--{option}", required=True, help="as configured")
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()

    from pipeline.report.index.numbers import claims, headlines, scores
    from pipeline.report.index.objects import rows
    from pipeline.report.index.runs import runs, settings
    from pipeline.scene.objects import described
    from pipeline.scene.pages import page

    names = sorted(options.objects, key=lambda name: name != options.source)  # the known one first
    read = [read_json(path) for path in options.numbers]
    told = [row for numbers in read for row in numbers.pop("claims", [])]
    numbers = {key: value for numbers in read for key, value in numbers.items()}
    html = page(
        "report/index/assets/index.html",
        headlines=headlines(numbers),
        scores=scores(numbers),
        claims=claims(told),
        figures=pictures(options.figures),
        scans=scans(options.scans),
        rows=rows(options.processed, options.source, names, options.uncertainties, numbers),
        objects=[
            described(name, options.processed, options.source)
            for name in command.progress(names, len(names), "page: objects")
        ],
        source=options.source,
        settings=settings(options, numbers),
        runs=runs(),
    )
    with replacing(options.output) as temporary:
        temporary.write_text(html)


def pictures(paths: Sequence[Path]) -> list[dict]:
    """Return what the page shows of each PDF: file, title, words for who cannot see it, caption, pages as images."""
    from pipeline.report.index.figures import FIGURES, images

    shown = []
    for path in command.progress(paths, len(paths), "page: figures"):
        title, caption = FIGURES.get(path.stem, (path.stem.replace("_", " ").capitalize(), ""))
        shown.append({"file": path.name, "title": title, "caption": caption, "pages": images(path)})
    return shown


def scans(paths: Sequence[Path]) -> list[dict]:
    """Return each object's page on its scan as an image."""
    from pipeline.report.index.figures import small_png

    return [
        {"name": path.stem, "title": path.stem.replace("_", " "), "image": small_png(path)} for path in paths
    ]


if __name__ == "__main__":
    command.run(main)
