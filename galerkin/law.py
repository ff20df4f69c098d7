"""The constitutive law: what tension a strain brings, how it grows, and what it stores.  The only place it stands."""

from cablefem.compiled import compiler

compiled = compiler(__file__)

LAWS = ("elastic", "tension-only")  # a law is its index to compiled code


@compiled
def tension(strain, T, alpha, law):
    """N, dN/deps and the energy int N deps from the static state, where N = T, and the elastic N; all at one point.

    elastic       N = T + alpha eps
    tension-only  N = max(0, T + alpha eps); slack, the energy is what the cable gave back on its way to N = 0
    """
    N = T + alpha * strain
    if law == 1 and N < 0.0:
        return 0.0, 0.0, -0.5 * T * T / alpha, N
    return N, alpha, (T + 0.5 * alpha * strain) * strain, N
