"""What the command `run` offers, and why a run may be refused."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cablefem.scene import Scene
    from validation.core.methods import Method

QUASI_STATIC = "quasi-static"
CHOICES = {
    "model": ("full", "stretching", "sagged", "string", QUASI_STATIC), "load": ("mass", "force"),
    "law": ("auto", "elastic", "tension-only"),
}  # fmt: skip


def option_faults(
    options: Mapping[str, object], tol: float | None, method: "Method | None", before: str = ""
) -> list[str]:
    """Sentences: an unknown model, load or law, or why the tolerance cannot be met.

    method : None: it is not known;  before : what stands before the names.
    """
    from cablefem.scene.errors import did_you_mean, short_text  # slow to load
    from validation.core.agreement import TOL_HIGH, TOL_LOW, range_faults

    faults = [
        f"{before}{name} = {short_text(choice)}: unknown.{did_you_mean(str(choice), CHOICES[name])}"
        for name, choice in options.items()
        if choice not in CHOICES[name]
    ]
    if tol is not None:
        faults += range_faults(f"{before}tol", tol, TOL_LOW, TOL_HIGH)
        if method is not None and method.wrong:
            faults.append(f"{method.name} converges to a wrong answer: no resolution meets a tolerance")
    return faults


def setting_faults(
    scene: "Scene", method: "Method", options: dict[str, Any], settings: dict[str, Any], tol: float | None,
    before: str = "",
) -> list[str]:  # fmt: skip
    """Sentences: why a method cannot run a scene with these options, settings and tolerance; before : see above."""
    from validation.core.running import Run

    chosen = method.resolution.setting, "steps"
    if tol is not None and (both := [key for key in settings if key in chosen]):
        why = f"{before}tol exclude each other: {before}tol chooses {' and '.join(chosen)}"
        return [f"{'--set ' if before else ''}{key} and {why}" for key in both]
    try:
        Run(scene, method, **options, **settings)
    except ValueError as error:
        return str(error).splitlines()
    return []
