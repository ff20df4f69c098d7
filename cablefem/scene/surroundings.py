"""What the car and the rope may hit: obstacles and the ground."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from cablefem.scene.errors import SceneError, short_text
from cablefem.scene.fields import (
    Admits,
    Pair,
    Part,
    Real,
    Word,
    described_field,
    list_of_tables_like,
    not_rising_faults,
)
from cablefem.scene.limits import KINDS

GROUND = "the ground"  # its name beside those of obstacles


class Obstacle(Part):
    name: Word = described_field("[-] its name in the results")
    at: Real = described_field("[m] x, from the left support")
    top: Real = described_field("[m] depth of its top below the left support")
    kind: Literal[tuple(KINDS)] | None = described_field("[-] what it is, for limits", None)  # type: ignore[valid-type]


def _require_profile(points: tuple[Pair, ...]) -> tuple[Pair, ...]:
    """The points; ValueError unless they are two or more with rising x."""
    if len(points) == 1 or not_rising_faults("x", [x for x, _ in points]):
        raise ValueError("no profile")
    return points


_WORDS = "a list of at least two points [x, depth], x strictly increasing, or the name of a CSV file of them"
Ground = Annotated[
    tuple[Pair, ...], Field(strict=False), AfterValidator(_require_profile), Admits(_WORDS),
    Field(
        description="[m] points [x, depth below the left support], linear between them, or a CSV file",
        json_schema_extra={"type": ["array", "string"]},
    ),
]  # fmt: skip
Obstacles = Annotated[
    tuple[Obstacle, ...], list_of_tables_like("{name = ..., at = ..., top = ...}"),
    Field(description="[-] what the rope and the cars must clear"),
]  # fmt: skip


def replace_ground_file_by_points(tables: dict[str, Any], folder: Path) -> None:
    """Replace the name of a CSV file in `ground` of a scene's tables by its points; SceneError."""
    if isinstance(name := tables.get("ground"), str):
        tables["ground"] = read_ground(name, folder)


def read_ground(name: str, folder: Path) -> list[list[float]]:
    """Points of a CSV file with columns x and depth [m]; a first row of words without digits names them."""
    try:
        reader = csv.reader((folder / name).read_text(encoding="utf-8-sig").splitlines())
        rows = [(reader.line_num, row) for row in reader if row]
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise SceneError([f"ground = {short_text(name)}: must be a readable CSV file in {folder} ({why})"]) from None
    if rows and not re.search(r"\d", "".join(rows[0][1])):
        del rows[0]
    points = []
    for number, row in rows:
        try:
            x, depth = map(float, row)
        except ValueError:
            must = f"line {number} {short_text(row)} must hold two numbers, x and depth"
            raise SceneError([f"ground = {short_text(name)}: {must}"]) from None
        points.append([x, depth])
    return points


def obstacle_faults(obstacles: tuple[Obstacle, ...], span: float) -> list[str]:
    """Faults of obstacles between supports with this span [m]."""
    faults: list[str] = []
    names = [x.name for x in obstacles]
    for i, x in enumerate(obstacles):
        name = f"obstacle[{i}].name = {short_text(x.name)}"
        if x.name in names[:i]:
            faults.append(f"{name}: given twice; names must differ")
        if x.name == GROUND:
            faults.append(f"{name}: stands for `ground`; must be another name")
        if not 0.0 <= x.at <= span:
            faults.append(f"obstacle[{i}].at = {x.at!r}: must be from 0 to {span:.6g} m, between the supports")
    return faults
