class StepFailure(RuntimeError):
    """A step failed; `t` [system's time], `cause`, and what to try."""

    def __init__(self, t: float, cause: str, advice: str) -> None:
        super().__init__(f"{cause} at t = {t:.6g}; {advice}")
        self.t = t
        self.cause = cause
        self.advice = advice


class NewtonStalled(StepFailure):
    """Newton's method did not converge."""


class EndlessEvents(StepFailure):
    """Events repeat without end."""


class StepUnderflow(StepFailure):
    """A step is within rounding of t."""
