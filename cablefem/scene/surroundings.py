"""What the car and the rope may hit: obstacles and the ground."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Annotated, Any

from cablefem.scene.errors import SceneError, shown
from cablefem.scene.fields import Check, Part, Real, Word, real, said


class Obstacle(Part):
    name: Word = said("[-] its name in the results")
    at: Real = said("[m] x, from the left support")
    top: Real = said("[m] depth of its top below the left support")


def _points(value: object) -> tuple[tuple[float, float], ...] | None:
    """Pairs (x, depth) with increasing x; else None."""
    if not isinstance(value, list | tuple) or len(value) == 1:
        return None
    points: list[tuple[float, float]] = []
    for pair in value:
        numbers = [real(x) for x in pair] if isinstance(pair, list | tuple) else []
        if len(numbers) != 2 or None in numbers or (points and not numbers[0] > points[-1][0]):  # type: ignore[operator]
            return None
        points.append((numbers[0], numbers[1]))  # type: ignore[arg-type]
    return tuple(points)


_GROUND = Check(
    "a list of at least two points [x, depth], x strictly increasing, or the name of a CSV file of them", _points,
    {"type": ["array", "string"]},
)  # fmt: skip
Ground = Annotated[tuple[tuple[float, float], ...], _GROUND]


def read_ground(name: str, folder: Path) -> list[list[float]]:
    """Points of a CSV file with columns x and depth [m]; a header is skipped."""
    path = folder / name
    try:
        rows = [row for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()) if row]
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise SceneError([f"ground = {shown(name)}: must be a readable CSV file in {folder} ({why})"]) from None
    points: list[list[float]] = []
    for i, row in enumerate(rows):
        try:
            x, depth = (float(cell) for cell in row[:2])
        except ValueError:
            if i == 0:
                continue
            raise SceneError(
                [f"ground = {shown(name)}: row {i + 1} {shown(row)} must hold two numbers, x and depth"]
            ) from None
        points.append([x, depth])
    return points


def surroundings_faults(data: dict[str, Any], span: float) -> list[str]:
    faults, names, obstacles = [], [], data.get("obstacle")
    for i, obstacle in enumerate(obstacles if isinstance(obstacles, list | tuple) else ()):
        given = obstacle if isinstance(obstacle, dict) else obstacle.model_dump() if isinstance(obstacle, Part) else {}
        name, at = given.get("name"), real(given.get("at"))
        if name in names:
            faults.append(f"obstacle[{i}].name = {shown(name)}: given twice; names must differ")
        names.append(name)
        if at is not None and not 0.0 <= at <= span:
            faults.append(f"obstacle[{i}].at = {at!r}: must be from 0 to {span:.6g} m, between the supports")
    return faults
