"""How a run may end before its end."""


class StepFailure(RuntimeError):
    """A step could not be taken; `t` [system's time], `cause`, and what to try."""

    def __init__(self, t: float, cause: str, advice: str) -> None:
        super().__init__(f"{cause} at t = {t:.6g}; {advice}")
        self.t, self.cause, self.advice = t, cause, advice


class NewtonStalled(StepFailure):
    """Newton's method found no balance at the end of the step."""


class EndlessEvents(StepFailure):
    """Events follow one another without end."""

    def __init__(self, t: float, cause: str) -> None:
        super().__init__(t, cause, "what changes at the event does not keep it from happening again at once")


class StepUnderflow(StepFailure):
    """A step has become so short that rounding does not resolve it."""
