"""The documentation site: `make docs` builds it into build/docs; it needs no network, neither to be built nor to be read.

By Sphinx, with pages in Markdown: MkDocs and its Material theme are no longer maintained, their successor Zensical is not at 1.0.
"""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "src")]

import docstrings  # noqa: E402
import generated  # noqa: E402

project = "warped-pouring"
copyright = "the authors of warped-pouring, BSD-3-Clause"
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc"]
exclude_patterns = ["_static"]
nitpicky = False

# Markdown: `#heading` links inside pages.
myst_heading_anchors = 3
myst_enable_extensions = ["attrs_inline"]

# Docstrings say `code` between single backticks, as Markdown does.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
add_module_names = False
toc_object_entries = False

html_theme = "furo"
html_title = "warped-pouring"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
pygments_style = "a11y-high-contrast-light"
pygments_dark_style = "a11y-high-contrast-dark"


def setup(app) -> None:
    """Write the reference's pages from the code before anything is read; take docstrings as they are written."""
    app.connect("builder-inited", lambda _: generated.write(HERE / "reference"))
    app.connect("autodoc-process-docstring", docstrings.process)
