"""Numbers with units as people write them: 60%, 150ml, 45deg, 5cm."""

import math
import re

from pipeline.errors import PipelineError

_NUMBER = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)")
VOLUMES_M3 = {"ml": 1e-6, "cl": 1e-5, "l": 1e-3, "m3": 1.0}
LENGTHS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
ANGLES_RAD = {"": math.pi / 180, "deg": math.pi / 180, "°": math.pi / 180, "rad": 1.0}


def volume_m3(text: str, option: str, capacity_m3: float) -> float:
    """Return a volume in m³; a share in % is one of the capacity."""
    value = _value(text, option, VOLUMES_M3 | {"%": capacity_m3 / 100}, "60% or 150ml")
    if not 0 <= value <= capacity_m3:
        raise PipelineError(
            f"{option} {text}: expected a volume from 0% to 100%, which are {capacity_m3 * 1e6:.0f} ml, found "
            f"{value * 1e6:.0f} ml; correct it"
        )
    return value


def length_m(text: str, option: str) -> float:
    """Return a length in metres."""
    return _value(text, option, LENGTHS_M, "5cm or 20mm")


def angle_rad(text: str, option: str) -> float:
    """Return an angle in radians; without a unit it is in degrees."""
    value = _value(text, option, ANGLES_RAD, "45 (degrees) or 0.8rad")
    if not 0 <= value <= math.pi:
        raise PipelineError(
            f"{option} {text}: expected a tilt from 0 to 180 degrees, found {math.degrees(value):g}; correct it"
        )
    return value


def _value(text: str, option: str, units: dict[str, float], such_as: str) -> float:
    match = _NUMBER.fullmatch(text.strip())
    if not match or match[2] not in units:
        known = " ".join(unit for unit in units if unit)
        raise PipelineError(
            f"{option} {text}: expected a number with a unit ({known}), such as {such_as}, found '{text}'; correct it"
        )
    return float(match[1]) * units[match[2]]
