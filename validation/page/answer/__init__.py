"""The page of an answer: course of the ride, side view, forces, reliability."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cablefem.response import Response

EVENTS = ("release", "thrust_end", "brake", "turn", "stop", "arrival", "back", "lift_off")


def write_animations(folder: Path, runs: "Iterable[Response]") -> None:
    """Write what ParaView animates, of each run to the folder of its method."""
    from validation.page import paraview  # slow to load

    for run in runs:
        paraview.write_paraview_files(run, folder / run.method)
