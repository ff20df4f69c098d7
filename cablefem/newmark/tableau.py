"""Collocation rules and interpolation within steps."""

from collections.abc import Sequence
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial, polynomial
from numpy.typing import NDArray

from cablefem.newmark.states import Array, Collocated, State

Complex = NDArray[np.complex128]


class Tableau(NamedTuple):
    """A collocation rule with nodes c (s,) and their Lagrange polynomials l_j."""

    c: Array
    A: Array  # A_ij = int_0^c_i l_j
    AA: Array
    ends: Array  # (2, s) b A and b, b_j = int_0^1 l_j: to q and v at the end
    eigenvalues: Complex  # (m,) eigenvalues, one of each pair
    to_modes: Complex  # (m, s) to eigenvectors
    from_modes: Complex  # (s, m) and back, real part
    middle: int  # node nearest to the middle of the step
    powers: tuple[Array, Array, Array]  # coefficients of l_j and of its two integrals from the end, (., s)

    def node_times(self, t: Array) -> Array:
        """Node times (m, s) of steps between t (m + 1,)."""
        at = t[:-1, None] + (t[1:] - t[:-1])[:, None] * self.c
        if self.c[-1] == 1.0:
            at[:, -1] = t[1:]
        return at


@cache
def tableau(nodes: tuple[float, ...]) -> Tableau:
    """The collocation rule with these nodes, in units of the step."""
    c = np.array(nodes)
    basis = []
    for j, x in enumerate(c):
        others = np.delete(c, j)
        basis.append(Polynomial.fromroots(others) / np.prod(x - others))
    A = np.stack([p.integ()(c) for p in basis], axis=1)
    b = np.array([p.integ()(1.0) for p in basis])
    eigenvalues, vectors = np.linalg.eig(A)
    one_of_pair = eigenvalues.imag >= 0.0
    to_modes = np.linalg.inv(vectors)[one_of_pair]
    count = np.where(eigenvalues.imag > 0.0, 2.0, 1.0)  # for a pair one vector, twice
    from_modes = np.ascontiguousarray((count * vectors)[:, one_of_pair].astype(complex))
    l0, l1, l2 = (np.array([p.integ(k, lbnd=1.0).coef for p in basis]).T for k in range(3))
    return Tableau(
        c=c, A=A, AA=A @ A, ends=np.stack([b @ A, b]), eigenvalues=eigenvalues[one_of_pair].astype(complex),
        to_modes=to_modes.astype(complex), from_modes=from_modes, middle=int(np.argmin(np.abs(c - 0.5))),
        powers=(l0, l1, l2),
    )  # fmt: skip


@lru_cache(maxsize=256)
def extrapolation_matrix(nodes: tuple[float, ...], ratio: float) -> Array:
    """(s, s) from accelerations to their extrapolation in a step `ratio` as long."""
    rule = tableau(nodes)
    return np.vander(1.0 + ratio * rule.c, len(nodes), increasing=True) @ rule.powers[0]


def with_states_inside_steps(states: Sequence[State], count_per_step: int) -> list[State]:
    """A history with so many states for each collocation step."""
    out = list(states[:1])
    for before, after in pairwise(states):
        if isinstance(after, Collocated):
            t = np.linspace(after.t - after.inside.dt, after.t, count_per_step + 1)[1:-1]
            out += [state_inside_step(after, x) for x in t[t > before.t].tolist()]
        out.append(after)
    return out


def state_inside_step(after: Collocated, t: float) -> State:
    """The state at t inside the collocation step that ends in `after`, by its polynomial."""
    nodes, dt, accelerations = after.inside
    x = (t - after.t) / dt + 1.0
    a, once, twice = (polynomial.polyval(x, p) @ accelerations for p in tableau(nodes).powers)
    q = after.q + dt * (x - 1.0) * after.v + dt * dt * twice
    v = after.v + dt * once
    return State(t, q, v, a, after.phase)


def interpolate_hermite(x: Any, dt: Any, before: Any, after: Any) -> tuple[Array, Array]:
    """q and v at x in [0, 1] of a step dt, cubic from q and v at both ends."""
    d = after.q - before.q
    v0 = dt * before.v
    v1 = dt * after.v
    c2 = 3.0 * d - 2.0 * v0 - v1
    c3 = v0 + v1 - 2.0 * d
    q = before.q + x * (v0 + x * (c2 + x * c3))
    v = (v0 + x * (2.0 * c2 + x * 3.0 * c3)) / dt
    return q, v
