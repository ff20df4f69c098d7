"""What the command `run` offers."""

QUASI_STATIC = "quasi-static"
CHOICES = {
    "model": ("full", "stretching", "sagged", "string", QUASI_STATIC), "load": ("mass", "force"),
    "law": ("auto", "elastic", "tension-only"),
}  # fmt: skip
