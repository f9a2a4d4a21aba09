"""The liquid: smoothed particles in scanned containers. What the trials call; the parts are in the modules named below.

`vessel` precomputes a container (walls), `settle` and `particles_for` fill it (rest), `pour` tilts it alone (pouring) and
`fill` above a second one (filling). Each is a pure function of geometry, arguments and seed.
"""

from pipeline.simulate.filling import Filling, fill
from pipeline.simulate.pouring import Pour, pour
from pipeline.simulate.rest import holds, keeps, particles_for, settle, settle_all
from pipeline.simulate.walls import Vessel, vessel

__all__ = [
    "Filling",
    "Pour",
    "Vessel",
    "fill",
    "holds",
    "keeps",
    "particles_for",
    "pour",
    "settle",
    "settle_all",
    "vessel",
]
