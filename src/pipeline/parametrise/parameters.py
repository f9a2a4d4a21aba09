"""All parameters that there are (section II-D and more): importing this module registers them."""

from pipeline.parametrise import hull, inside, rim, standing  # noqa: F401
from pipeline.parametrise.library import INGREDIENTS, PARAMETERS, evaluate, known, numbers

__all__ = ["INGREDIENTS", "PARAMETERS", "evaluate", "known", "numbers"]
