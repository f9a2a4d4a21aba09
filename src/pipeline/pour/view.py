"""Look at objects in the browser: parts, opening, lip, and the liquid at any fill and tilt.

Shows the object with the labels that the warp gave it, or the initial ones as long as there are no others. Works when
the object has been fused; what else there is is shown.
"""

import argparse
from typing import Any

from pipeline.pour.project import Project


def options(parser: argparse.ArgumentParser) -> None:
    """Add this subcommand's options."""
    parser.add_argument("object", nargs="+", help="names of objects; the first is shown first")
    page_options(parser)


def page_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a subcommand that serves a page."""
    parser.add_argument("--port", type=int, default=0, help="port on this machine; 0: any that is free")
    parser.add_argument("--no-browser", action="store_true", help="tell the address only")


def call(options: argparse.Namespace) -> dict[str, Any]:
    """Serve the page until Ctrl-C; return what was shown."""
    project = Project(options.project)
    names = [project.check(name) for name in options.object]
    for name in names:
        project.made(f"fuse/{name}/mesh.ply")

    from pipeline.pour.server import serve
    from pipeline.scene.objects import described
    from pipeline.scene.pages import page

    source = project.source()
    objects = [described(name, project.processed, source) for name in names]
    html = page("scene/assets/view.html", name=names[0], objects=objects)
    serve(lambda _: html, {}, port=options.port, opened=not options.no_browser)
    return {"objects": names}


def text(result: dict[str, Any]) -> str:
    """Say nothing: what there was to see was in the browser."""
    return ""
