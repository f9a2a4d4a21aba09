"""Figures as images inside a page."""

import base64
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import PipelineError

if TYPE_CHECKING:
    from PIL.Image import Image

PIXELS_AN_INCH = 220
COLOURS = 96  # figures have few; as a palette they are a quarter of the size

# Title and caption of each figure by its file's name; the caption also tells what there is to see to who cannot see it.
FIGURES = {
    "roc": (
        "When does it pour, and when does it fill?",
        "True against false positive rate of classifiers that were trained on 50 trials of one object, as the paper's Fig. 3: "
        "pouring on the left, filling on the right. Dashed: other trials of the same object. Solid: objects that were never "
        "seen. Grey: what hydrostatics says of the same trials.",
    ),
    "evaluation": (
        "How sure are these numbers?",
        "Training object against test object, scores with intervals over objects, calibration, learning curves and paired tests.",
    ),
    "ablations": (
        "What matters?",
        "The same scores with one choice changed at a time: warping method, source, volume, features, sampling.",
    ),
    "labels": (
        "Which part is which?",
        "Container, rim and handle: painted on the source, first estimated and then mapped by the warp on every target, as the "
        "paper's Fig. 2.",
    ),
    "parameters": (
        "What was read off the warp?",
        "Parameters of every object with their uncertainties, beside the true ones where these are known.",
    ),
    "promp": (
        "How was pouring shown?",
        "Demonstrated pours and the probabilistic movement primitive that was learnt from them, as the paper's Fig. 4; a page a "
        "feature set, by whose parameters all is divided.",
    ),
    "execution": (
        "Does the robot pour?",
        "Pours that the simulated robot executed with the demonstrated pair and with novel objects, as the paper's Fig. 5; how "
        "often they succeeded is on the further page.",
    ),
    "watching": (
        "Does it know when it pours?",
        "What the classifiers say along each executed pour: the probability that the cup pours, and that what it pours ends in the "
        "second container, against the first ball and the first drop of liquid.",
    ),
    "physics": (
        "Is the liquid one?",
        "The simulated liquid against hydrostatics: density, level, capacity, spill angle and retained volume; the same trials "
        "by other engines.",
    ),
}


def images(path: Path) -> list[dict[str, Any]]:
    """Return every page of a PDF as PNG (data address) with its size in CSS pixels (96 an inch)."""
    import pypdfium2

    try:
        document = pypdfium2.PdfDocument(path)
    except (FileNotFoundError, pypdfium2.PdfiumError) as error:
        raise PipelineError(
            f"{path}: expected a figure as PDF, but it cannot be read: {error}; make it again"
        ) from error
    pages = []
    for number in range(len(document)):
        page = document[number]
        width, height = page.get_size()
        picture = page.render(scale=PIXELS_AN_INCH / 72).to_pil()
        pages.append(
            {"image": png(picture), "width": round(width * 96 / 72), "height": round(height * 96 / 72)}
        )
        page.close()
    document.close()
    return pages


def small_png(path: Path) -> str:
    """Return an image file as a PNG of few colours (data address)."""
    from PIL import Image

    with Image.open(path) as picture:
        return png(picture)


def png(picture: "Image") -> str:
    """Return a picture as the data address of a PNG with a palette."""
    from PIL import Image

    few = picture.convert("RGB").quantize(COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    content = io.BytesIO()
    few.save(content, "PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(content.getvalue()).decode()
