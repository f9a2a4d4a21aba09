"""What all figures share: fonts that print, one colour and one word for each feature set."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.artefacts import replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, distinct to colour-blind readers and in grey.
COLOURS = {
    "label_mapping": "#0072B2",
    "point_mapping": "#D55E00",
    "standard": "#009E73",
    "conditioned": "#CC79A7",
    "hydrostatic": "#7F7F7F",
}
WORDS = {
    "label_mapping": "label mapping",
    "point_mapping": "point mapping",
    "standard": "standard features",
    "conditioned": "conditioned on the pair",
    "hydrostatic": "hydrostatic ceiling",
}
RC: Any = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 9,
    "legend.fontsize": 7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "pdf.fonttype": 42,
}


def save(figure: "Figure | Sequence[Figure]", path: Path) -> None:
    """Write a figure, or some as pages, as PDF; the same bytes for the same figures."""
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

    about = {"CreationDate": None, "Creator": "warped-pouring", "Producer": None}
    with replacing(path) as temporary, PdfPages(temporary, metadata=about) as pages:
        for page in [figure] if isinstance(figure, Figure) else figure:
            pages.savefig(page)
