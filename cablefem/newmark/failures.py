"""Failures of a run."""


class StepFailure(RuntimeError):
    """A step failed; `t` [system's time], `cause`, and what to try."""

    def __init__(self, t: float, cause: str, advice: str) -> None:
        super().__init__(f"{cause} at t = {t:.6g}; {advice}")
        self.t, self.cause, self.advice = t, cause, advice


class NewtonStalled(StepFailure):
    """Newton's method did not converge."""


class EndlessEvents(StepFailure):
    """Events repeat without end."""

    def __init__(self, t: float, cause: str) -> None:
        super().__init__(t, cause, "what changes at the event does not keep it from happening again at once")


class StepUnderflow(StepFailure):
    """A step is within rounding of t."""
