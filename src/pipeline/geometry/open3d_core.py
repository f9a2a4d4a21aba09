"""Open3D without its web viewer: the Dash that this one imports takes longer to load than all the rest."""

import sys
from types import ModuleType

__all__ = ["open3d"]

_VIEWER = "open3d.visualization.draw_plotly"
_VIEWERS = ("get_plotly_fig", "draw_plotly", "draw_plotly_server")

if "open3d" not in sys.modules:
    _left_out = ModuleType(_VIEWER, "Left out: import Open3D before the pipeline to have it.")
    vars(_left_out).update(dict.fromkeys(_VIEWERS))
    sys.modules[_VIEWER] = _left_out

import open3d  # noqa: E402
