"""Mass-following elements of the full cable as scikit-fem forms, the reference of `kernels`.

Unknowns w = (u, v) on 0 <= s <= 1; nodes move with c(s, t):

    int (w_tt + c_s w_t - c w_t' - c_t w' + c_d (w_t - c w')) . phi + (c w_t - c^2 w') . phi' ds
                                                                                            `inertia_and_damping_form`
    + int (N t - T X') . phi' ds,  r' = X' + w', t = r'/|r'|, N = T + alpha (|r'| - 1)      `internal_force_form`
    + [mu w_tt + mu d2X/dt2 - mu sigma j] at the mass = 0 .

w_t, w_tt, c_t are rates at a node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import skfem

from cablefem.elements.kernels.law import TENSION_ONLY
from cablefem.elements.reference import element_unknowns, force_quadrature_order, lagrange_element
from cablefem.newmark import Array

if TYPE_CHECKING:
    from cablefem.elements.following import FollowingElements


def tension_stiffness_energy(strain: Any, T: Any, alpha: float, law: float) -> tuple[Any, Any, Any]:
    """N, dN/dstrain and the strain energy W from the static state."""
    N = T + alpha * strain
    W = (T + 0.5 * alpha * strain) * strain
    if law != TENSION_ONLY:
        return N, alpha, W
    taut = N > 0.0
    stiffness = np.where(taut, alpha, 0.0)
    energy = np.where(taut, W, -0.5 * T * T / alpha)
    return np.where(taut, N, 0.0), stiffness, energy


def length_from_components(vector: Any) -> Any:
    """Length of vectors (2, ...); np.hypot is slow."""
    x, y = vector
    return np.sqrt(x * x + y * y)


def strain(X_s: Any, w_s: Any, stretch: Any) -> Any:
    """|r'| - 1 without cancellation; stretch : |r'|, r' = X' + w'."""
    by_x = (2.0 * X_s[0] + w_s[0]) * w_s[0]
    by_y = (2.0 * X_s[1] + w_s[1]) * w_s[1]
    return (by_x + by_y) / (stretch + 1.0)


class Section(NamedTuple):
    """What a section of the cable bears at r' = X' + w'."""

    force: Any  # N t - T X' (2, ...)
    N: Any
    stiffness: Any  # dN/deps
    energy: Any  # W
    strain: Any  # |r'| - 1
    stretch: Any  # |r'|


def section_state(X_s: Any, T: Any, w_s: Any, alpha: float, law: float) -> Section:
    """The section with slopes w' (2, ...) from X'; differences of nearly equal numbers are avoided."""
    stretch = length_from_components(X_s + w_s)
    eps = strain(X_s, w_s, stretch)
    N, dN, W = tension_stiffness_energy(eps, T, alpha, law)
    excess = (N - T) - T * eps
    force = N / stretch * w_s + excess / stretch * X_s
    return Section(force, N, dN, W, eps, stretch)


def section_stiffness(X_s: Any, T: Any, w_s: Any, alpha: float, law: float) -> Any:
    """df/dw' (2, 2, ...), f : `Section.force`."""
    x = section_state(X_s, T, w_s, alpha, law)
    t = (X_s + w_s) / x.stretch
    unit = np.eye(2).reshape(2, 2, *[1] * np.ndim(x.stretch))
    across = x.N / x.stretch
    along = x.stiffness - across
    return across * unit + along * t[:, None] * t[None]


@skfem.LinearForm
def internal_force_form(eta, w):
    f = section_state(w["X_s"], w["T"], w["w_s"], w["alpha"], w["law"]).force
    return np.sum(f * eta.grad[:, 0], axis=0)


@skfem.LinearForm
def inertia_and_damping_form(eta, w):
    c = w["c"]
    v = w["v"]
    q_s = w["q"].grad[:, 0]
    v_s = v.grad[:, 0]
    acceleration = w["a"] + w["c_s"] * v - c * v_s - w["c_t"] * q_s
    by_value = acceleration + w["c_d"] * (v - c * q_s)
    by_slope = c * v - c**2 * q_s
    return np.sum(by_value * eta + by_slope * eta.grad[:, 0], axis=0)


def assemble_residual(system: FollowingElements, x: Array, t: float, phase: int) -> Array:
    """The residual (n_dof,) at x, rows q, v, a, assembled by scikit-fem on the mesh of time t."""
    s_o, ds, dds = system.motion.position_with_rates(t, phase)
    g = system.groups
    degree = system.reference.degree
    knots = system.reference.knots
    mesh = skfem.MeshLine(s_o + np.where(knots < 0.0, s_o, 1.0 - s_o) * knots)
    element = skfem.ElementVector(lagrange_element(degree), 2)
    basis = skfem.Basis(mesh, element, intorder=2 * degree)
    basis_of_forces = skfem.Basis(mesh, element, intorder=force_quadrature_order(degree))

    # scikit-fem's unknowns in ours, which leave out the supports
    number = np.empty(basis.N, dtype=int)
    of_elements = 2 * (element_unknowns(degree, mesh.nelements).T - 1)
    for field in range(2):
        number[basis.element_dofs[field::2]] = of_elements + field
    inner = (number >= 0) & (number < system.n_dof)
    unknowns = np.zeros((3, number.size))
    unknowns[:, inner] = x[:, number[inner]]

    s = np.asarray(basis.global_coordinates())[0]
    behind = s < s_o
    chi = np.where(behind, s / s_o, (1.0 - s) / (1.0 - s_o))
    chi_s = np.where(behind, 1.0 / s_o, -1.0 / (1.0 - s_o))
    fields = {name: basis.interpolate(values) for name, values in zip("qva", unknowns, strict=True)}
    mesh_motion = {"c": ds * chi, "c_s": ds * chi_s, "c_t": dds * chi}
    r = inertia_and_damping_form.assemble(basis, c_d=g.damping, **fields, **mesh_motion)

    at_forces = np.asarray(basis_of_forces.global_coordinates())[0]
    T, *X_s = g.tension_and_slope(at_forces)
    w_s = basis_of_forces.interpolate(unknowns[0]).grad[:, 0]
    law = float(system.law == "tension-only")
    section = {"T": T, "X_s": np.stack(X_s), "w_s": w_s}
    r += internal_force_form.assemble(basis_of_forces, alpha=g.alpha, law=law, **section)

    r = r[np.argsort(number)[2:-2]]  # without the supports
    at_mass = [2 * system.node, 2 * system.node + 1]
    load = system._inertia_less_weight_of_mass(s_o, ds, dds)
    r[at_mass] += system.inertia * x[2, at_mass] + load
    return r
