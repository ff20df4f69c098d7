"""The constitutive law: tension, stiffness and energy by strain."""

from __future__ import annotations

from cablefem.compiled import compiling_decorator

compiled = compiling_decorator(__file__)
inner = compiling_decorator(__file__, inner=True)
shared = compiling_decorator(__file__, inner=True, shared=True)

LAWS = ("elastic", "tension-only")  # a law is its index to compiled code


@inner
def tension_stiffness_and_energy(strain: float, T: float, alpha: float, law: int) -> tuple[float, float, float, float]:
    """N, dN/deps, the energy int N deps from the static state, and the elastic N.

    elastic       N = T + alpha eps
    tension-only  N = max(0, T + alpha eps)
    """
    N = T + alpha * strain
    if law == 1 and N < 0.0:
        return 0.0, 0.0, -0.5 * T * T / alpha, N
    return N, alpha, (T + 0.5 * alpha * strain) * strain, N
