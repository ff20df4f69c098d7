"""Sensitivity of a check: the smallest change of each key in one solver that changes a verdict."""

import math
import tomllib
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from cablefem.scene import SceneError
from validation.commands.check.study import Check
from validation.core.agreement import FACTOR_DISAGREE, Agreement
from validation.core.measures import NotComparable
from validation.core.methods import find_method
from validation.core.rows import TABLE
from validation.core.running import run
from validation.core.view import View
from validation.page.scene_keys import dotted_keys_and_values

Gaps = dict[tuple[str, str], float]  # by quantity and law
STEP = 0.1  # [percent] change of a key; rows are linear in it


def detectable_relative_changes(result: Check) -> dict[str, float]:
    """Smallest relative change of each input key in one solver that this check would detect.

    One run a key at half the resolution: changes of rows need fewer digits.
    """
    base = (*result.a.space.runs, result.a.finest)[0]
    view = View.of_scene(result.scene).cut_to_valid_range(result.a.finest, result.b.finest)

    def gaps_to(changed_scene: Any) -> Gaps:
        changed = run(
            changed_scene, find_method(base.method), until=view.last_needed_relative_position, **base.settings
        )
        changed = replace(changed, scene_toml=base.scene_toml)
        deciding = [q for q in TABLE if q.tolerance_kind and q.concerns(view)]
        return {(q.name, q.law): _gap_or_zero(q, changed, base, view) for q in deciding}

    return detectable_relative_changes_by_gaps(result.scene, result.rows, gaps_to)


def detectable_relative_changes_by_gaps(
    scene: Any, rows: Sequence[Agreement], gaps_to: Callable[[Any], Gaps]
) -> dict[str, float]:
    """The smallest relative change of each key of a scene that a row detects, if less than the key itself.

    gaps_to : gaps of a changed scene to the scene, by quantity and law.
    """
    bars = {(row.quantity, row.law): row.allowed for row in rows if row.decides}
    out = {}
    for key, value in dotted_keys_and_values(tomllib.loads(scene.to_toml()), by_name=True):
        if not value or isinstance(value, bool | str | list):
            continue
        changed = _scene_with_changed_key(scene, key)
        if changed is None:
            continue
        gaps = {row: gap for row, gap in gaps_to(changed).items() if gap > 0.0}
        # the gap grows with the change
        detected = [FACTOR_DISAGREE * bars.get(row, math.inf) * 0.01 * STEP / gap for row, gap in gaps.items()]
        if detected and min(detected) < 1.0:
            out[key] = min(detected)
    return dict(sorted(out.items(), key=lambda item: item[1]))


def _scene_with_changed_key(scene: Any, key: str) -> Any | None:
    """The scene with a key larger by STEP, or smaller where that is refused; None where both are."""
    for sign in "+-":
        with suppress(SceneError, ValueError):
            return scene.replace({key: f"{sign}{STEP}%"})
    return None


def _gap_or_zero(quantity: Any, changed: Any, base: Any, view: View) -> float:
    try:
        return quantity.gap(changed, base, view)
    except NotComparable:
        return 0.0


def detectable_changes_sentence(changes: dict[str, float]) -> str:
    """What a check would notice; changes : the smallest relative one that is detected, by key."""
    rounding = 1e-8  # a smaller relative one is any change of a number: its row has a bar of rounding alone
    parts = [f"{key} {100.0 * change:.2g} %" for key, change in changes.items() if change >= rounding]
    exact = [key for key, change in changes.items() if change < rounding]
    if exact:
        parts = [f"any change of {', '.join(exact)}", *parts]
    return f"would notice: {', '.join(parts)}" if parts else "would notice no fault of a key of the scene"
