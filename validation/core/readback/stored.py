"""What a run or a check stored, as what reads it back sees it."""

import tomllib
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from validation.core.scene_data import OneSpanData
from validation.core.stored_files import Entries, json_of_text, read_json

Faults = Iterator[str]
Run = dict[str, Any]  # stored arrays of a method by name, its TOML as "scene", its numbers as "rest"
Row = dict[str, Any]  # of a JSON file
ORDER = ("disagree", "not comparable", "too coarse", "agree")  # of verdicts: the first one counts
SHOWN_AS = {"too coarse": "too coarse to tell", "not comparable": "cannot be compared"}


class StoredResults:
    """What a run or a check stored in a folder: of methods, the first one's numbers are those shown."""

    def __init__(self, folder: Path, methods: Sequence[str], judged: bool) -> None:
        self.folder = folder
        self.methods = methods
        self.summaries = [read_json(folder / name / "summary.json") for name in methods]
        self.agreement = read_json(folder / "agreement.json") if judged else {}
        shown = self.agreement or self.summaries[0]
        self.design: list[Row] = shown["design"]
        self.shown_events: list[Row] = shown["events"]
        self.events: list[Row] = [*shown["events"], *self.agreement.get("quasi_static", [])]
        self.rows: list[Row] = self.agreement.get("rows", [])
        self.limits: list[Row] = shown.get("limits", [])
        self.outcome: str = self.summaries[0].get("outcome", "")
        self.unread: list[str] = []  # what has no reader

    @property
    def verdict_on_both_solvers(self) -> str:
        """The verdict on both solvers; another program has its own."""
        return worst_asked_verdict(row for row in self.rows if not row.get("with")) or "not comparable"

    @cached_property
    def runs(self) -> list[Run]:
        """Stored arrays of each method, with its scene's TOML."""
        return [_read_run(self.folder / name / "response.npz") for name in self.methods]

    @cached_property
    def scene_data(self) -> OneSpanData:
        """Numbers of the scene, SI."""
        rest = self.runs[0]["rest"]
        return OneSpanData(rest["scene_toml"], rest["length"])


def _read_run(file: Path) -> Run:
    with np.load(file, allow_pickle=False) as data:
        run: Run = Entries(file, "array", data)
    run["rest"] = json_of_text(file, str(run.pop("_rest")))
    run["scene"] = tomllib.loads(run["rest"]["scene_toml"])
    return run


def worst_asked_verdict(rows: Iterable[Row]) -> str | None:
    """The worst verdict of the rows that count; None without such rows."""
    verdicts = {row["verdict"] for row in rows if row["asked"]}
    return next((verdict for verdict in ORDER if verdict in verdicts), None)


def expected_excess_sentences(rows: Iterable[Row]) -> Iterator[str]:
    """How far the too coarse ones of stored comparisons exceed what was asked."""
    coarse = [row for row in rows if row["asked"] and row["verdict"] == "too coarse" and row["asked_for"]]
    if coarse and all(row["allowed"] is not None for row in coarse):
        excess = max(max(row["gap"], row["allowed"]) / row["asked_for"] for row in coarse)
        yield f"gaps and bars are up to {excess:.3g} times what was asked"


@cache
def read_package_toml(package: str, file: str) -> dict[str, Any]:
    """A TOML file that is shipped with a package, as "core" of validation or "cablefem.scene"."""
    home = package if package.startswith("cablefem") else f"validation.{package}"
    return tomllib.loads(resources.files(home).joinpath(file).read_text(encoding="utf-8"))
