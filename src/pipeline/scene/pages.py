"""Pages from templates: HTML that needs no network, with scripts, styles and data inside."""

from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parents[1]


def page(template: str, **values: Any) -> str:
    """Return the page of a template, such as `scene/assets/view.html`; `asset(name)` in it puts a file in as it is."""
    import jinja2
    from markupsafe import Markup

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(PACKAGE),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {"sort_keys": True, "allow_nan": False}
    environment.globals["asset"] = lambda name: Markup((PACKAGE / name).read_text())
    return environment.get_template(template).render(**values) + "\n"
