"""Limits that an answer is held against: those of texts in `limits.toml`, and numbers of a scene."""

import tomllib
from collections.abc import Iterator, Mapping
from importlib import resources
from typing import Annotated, Any

from pydantic import Field

from cablefem.scene.errors import did_you_mean
from cablefem.scene.fields import Admits, NonNegative, Part, Positive, Word, described_field

_SHIPPED = tomllib.loads((resources.files(__package__) / "limits.toml").read_text(encoding="utf-8"))
DEMANDS: dict[str, list[str]] = _SHIPPED["demand"]
TEXTS: dict[str, dict[str, Any]] = _SHIPPED["text"]
CASES: dict[str, dict[str, Any]] = _SHIPPED["case"]
KINDS = sorted({rule["kind"] for text in TEXTS.values() for rule in text["limit"] if "kind" in rule})
CIRCUMSTANCES = sorted({rule["when"] for text in TEXTS.values() for rule in text["limit"] if "when" in rule})

Words = Annotated[tuple[Word, ...], Field(strict=False), Admits("a list of words")]
Rule = dict[str, Any]


class Limits(Part):
    """Texts by name, what decides between their numbers, and a scene's own numbers."""

    use: Words = described_field("[-] texts, as cablefem scenes --limits names them", ())
    when: Words = described_field(f"[-] what applies of {', '.join(CIRCUMSTANCES)}", ())
    ground: Word | None = described_field(f"[-] what the ground is: {', '.join(KINDS)}", None)
    safety_factor: Positive | None = described_field("[-] least breaking load over largest tension", None)
    tension_over_contact: Positive | None = described_field("[-] least tension over the largest force across", None)
    tension_over_wheel: Positive | None = described_field("[-] least tension over the load of a wheel", None)
    clearance: NonNegative | None = described_field("[m] least clearance over all obstacles and the ground", None)
    sag_growth: NonNegative | None = described_field("[-] most of dynamic over static sag, less 1", None)
    arrival_speed: Positive | None = described_field("[m/s] most on arrival, or on reaching a brake", None)
    knee_empty: NonNegative | None = described_field("[deg] least of an empty line", None)
    knee_loaded: Positive | None = described_field("[deg] most of a loaded line, without the last support", None)
    knee_last: Positive | None = described_field("[deg] most of a loaded line at the last support", None)
    acceleration: Positive | None = described_field("[m/s2] most of the timetable", None)
    deceleration: Positive | None = described_field("[m/s2] most of the timetable", None)
    speed: Positive | None = described_field("[m/s] most", None)

    def cross_field_faults(self, written_values: Mapping[str, Any]) -> list[str]:
        faults = [
            f"use = {name!r}: unknown.{did_you_mean(name, TEXTS)}" for name in self.use or () if name not in TEXTS
        ]
        if self.ground is not None and self.ground not in KINDS:
            faults.append(f"ground = {self.ground!r}: unknown.{did_you_mean(self.ground, KINDS)}")
        unknown = [name for name in self.when or () if name not in CIRCUMSTANCES]
        return faults + [f"when = {name!r}: unknown.{did_you_mean(name, CIRCUMSTANCES)}" for name in unknown]

    def applicable_rules(self, span: float) -> Iterator[Rule]:
        """Rules that apply to a span [m], of each demand and kind the one for what is given in `when`."""
        for name in self.use:
            text = TEXTS[name]
            for rule in text["limit"]:
                if self._rule_applies(rule, text["limit"]) and span > rule.get("span_above", 0.0):
                    yield rule | {"text": name, "source": f"{text['source']}, {rule['clause']}"}
        for demand in DEMANDS:
            limit = getattr(self, demand, None)
            if limit is not None:
                yield {"demand": demand, "limit": limit, "text": "", "source": "the scene"}

    def _rule_applies(self, rule: Rule, rules: list[Rule]) -> bool:
        """Whether the circumstance of a rule is given; of one without, whether no special one takes its place."""
        if "when" in rule:
            return rule["when"] in self.when
        special = {(x["demand"], x.get("kind")) for x in rules if x.get("when") in self.when}
        return (rule["demand"], rule.get("kind")) not in special
