"""Other codes on the same scenes, an optional check: ``pip install cablefem[peers]``.

They take our static shape, static tension and travel.
"""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from validation.peers import exudyn, opensees
from validation.peers.path import PeerPath


@dataclass(frozen=True, slots=True)
class Peer:
    module: str
    run: Callable[..., PeerPath]  # of groups and the settings of a rung
    ladder: tuple[Mapping[str, int], ...]  # settings, coarse to fine
    rides: tuple[Mapping[str, int], ...] = ()  # of free rides, if it has them


_trusses = tuple({"elements": n} for n in (50, 100, 200, 500, 1000, 2000))
_beams = tuple({"elements": n, "steps": 20 * n} for n in (25, 50, 100, 200))
_rides = tuple({"elements": n, "steps": 100 * n} for n in (10, 20, 40, 80))
PEERS = {
    "opensees": Peer("openseespy.opensees", opensees.run_opensees_step_per_element, _trusses),
    "exudyn": Peer("exudyn", exudyn.run_exudyn, _beams, _rides),
}


def import_failure_reason(name: str) -> str | None:
    """Return None if the peer can be imported, else the reason."""
    module = PEERS[name].module
    try:
        importlib.import_module(module)
    except Exception as error:  # wheels raise anything if a library is missing
        if isinstance(error, ModuleNotFoundError) and error.name == module.split(".")[0]:
            return "not installed"
        cause: BaseException = error
        while cause.__cause__ or cause.__context__:
            cause = cause.__cause__ or cause.__context__  # type: ignore[assignment]
        return str(cause).partition("\n")[0] or type(cause).__name__
    return None
