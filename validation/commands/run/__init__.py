"""What the command `run` offers."""

from collections.abc import Mapping

QUASI_STATIC = "quasi-static"
CHOICES = {
    "model": ("full", "stretching", "sagged", "string", QUASI_STATIC), "load": ("mass", "force"),
    "law": ("auto", "elastic", "tension-only"),
}  # fmt: skip


def unknown_choice_faults(given: Mapping[str, object], before: str = "") -> list[str]:
    """Faults of a model, load or law that is none; before : what stands before its name."""
    from cablefem.scene.errors import did_you_mean, short_text  # slow to load

    return [
        f"{before}{name} = {short_text(choice)}: unknown.{did_you_mean(str(choice), CHOICES[name])}"
        for name, choice in given.items()
        if choice not in CHOICES[name]
    ]
