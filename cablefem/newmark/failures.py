"""How a run may end before its end."""

from __future__ import annotations


class StepFailure(RuntimeError):
    """A step could not be taken; `t` [system's time], `cause`, and what to try."""

    def __init__(self, t: float, cause: str, advice: str) -> None:
        super().__init__(f"{cause} at t = {t:.6g}; {advice}")
        self.t, self.cause, self.advice = t, cause, advice


class NewtonStalled(StepFailure):
    """Newton's method found no balance at the end of the step."""


class StepUnderflow(StepFailure):
    """A step has become so short that rounding does not resolve it."""
