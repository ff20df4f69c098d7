"""Reference meshes on 0 <= xi <= 1, tabulated by scikit-fem."""

from dataclasses import dataclass

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import coo_array

from cablefem.newmark import Array


def lagrange_element(degree: int) -> skfem.Element:
    """Return a new 1D element of that degree, for one set of points only.

    A reused ElementLinePp silently returns values at earlier points (scikit-fem 12.0.2).
    """
    if not (isinstance(degree, int) and 1 <= degree <= 8):
        raise ValueError(f"degree must be an integer from 1 to 8, got {degree!r}")
    if degree == 1:
        return skfem.ElementLineP1()
    if degree == 2:
        return skfem.ElementLineP2()
    return skfem.ElementLinePp(degree)


def shape_polynomials(element: skfem.Element) -> Array:
    """Return P (n_loc, n_loc): shape function k on [0, 1] is sum_m P[k, m] x^m."""
    n_loc = element.refdom.nnodes * element.nodal_dofs + element.interior_dofs
    x = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_loc) + 0.5) / n_loc)
    mesh = skfem.MeshLine(np.array([0.0, 1.0]))
    basis = skfem.Basis(mesh, element, quadrature=(x[None, :], np.ones(n_loc)))
    values = np.array([np.asarray(basis.basis[k][0])[0] for k in range(n_loc)])
    return np.linalg.solve(np.vander(x, increasing=True), values.T).T


@skfem.BilinearForm
def mass_form(phi, eta, w):
    return phi * eta


@skfem.BilinearForm
def transport_form(phi, eta, w):
    """Integral of w(xi) eta phi,xi dxi; w = mesh velocity over ds_o."""
    return w["pull"] * eta * phi.grad[0]


@skfem.BilinearForm
def convection_form(phi, eta, w):
    """Integral of w(xi)^2 eta,xi phi,xi dxi."""
    return w["pull"] ** 2 * eta.grad[0] * phi.grad[0]


def force_order(degree: int) -> int:
    """Return the order of quadrature of internal forces: as many Gauss points as the degree, at least two.

    More points lock (Stolarski & Belytschko 1982): there u' cannot follow v'^2/2.
    """
    return max(2, 2 * degree - 1)


def tabulated(basis: skfem.Basis) -> Array:
    """Return xi, weight, shape values and slopes at the points, (n_el, n_q, 2 + 2 n_loc)."""
    xi = np.asarray(basis.global_coordinates())[0]
    fields = [basis.basis[k][0] for k in range(basis.Nbfun)]
    columns = [xi, basis.dx, *(f.get(0) for f in fields), *(f.grad[0] for f in fields)]
    return np.stack([np.broadcast_to(np.asarray(x), xi.shape) for x in columns], axis=2)


@dataclass(frozen=True, slots=True)
class Reference:
    """One side of the mass; dofs are numbered along xi, ends included."""

    degree: int
    knots: Array  # (n_el + 1,)
    n: int  # scalar dofs
    dofs: NDArray[np.int64]  # (n_el, n_loc)
    forces: Array  # see `tabulated`, at the points of `force_order`
    inertia: Array  # the same at points exact for phi_i phi_j
    M: coo_array  # (n, n) integral phi_i phi_j
    G: coo_array  # (n, n) integral w phi_i phi_j,xi
    H: coo_array  # (n, n) integral w^2 phi_i,xi phi_j,xi
    shapes: Array  # see `shape_polynomials`

    def evaluate(self, xi: Array) -> tuple[NDArray[np.int64], Array, Array]:
        """Return (dofs, values, d/dxi), each (n_loc, ...), at xi in [0, 1]; at a knot of the left element."""
        e = np.clip(np.searchsorted(self.knots, xi, side="left") - 1, 0, self.knots.size - 2)
        length = self.knots[e + 1] - self.knots[e]
        x = (xi - self.knots[e]) / length
        powers = np.stack([x**m for m in range(self.degree + 1)])
        slopes = np.stack([m * x ** max(m - 1, 0) for m in range(self.degree + 1)])
        value = np.tensordot(self.shapes, powers, 1)
        grad = np.tensordot(self.shapes, slopes, 1) / length
        return np.moveaxis(self.dofs[e], -1, 0), value, grad


def along(basis: skfem.Basis, degree: int) -> NDArray[np.int64]:
    """Return numbers along the mesh for scikit-fem's unknowns, so that bands are narrow."""
    number, n_el = np.empty(basis.N, dtype=np.int64), basis.element_dofs.shape[1]
    number[basis.element_dofs[0]] = degree * np.arange(n_el)
    number[basis.element_dofs[1]] = degree * np.arange(1, n_el + 1)
    for k in range(2, degree + 1):
        number[basis.element_dofs[k]] = degree * np.arange(n_el) + k - 1
    return number


def reference(knots: Array, degree: int, pull_at_end: bool) -> Reference:
    """Tabulate one side: w(xi) = xi if pull_at_end, the mass at xi = 1, else 1 - xi."""
    mesh = skfem.MeshLine(knots)
    basis, of_forces = (
        skfem.Basis(mesh, lagrange_element(degree), intorder=order) for order in (2 * degree, force_order(degree))
    )
    xi, number = np.asarray(basis.global_coordinates())[0], along(basis, degree)
    pull = xi if pull_at_end else 1.0 - xi

    def operator(form: skfem.BilinearForm) -> coo_array:
        matrix = form.assemble(basis, pull=pull).tocoo()
        return coo_array((matrix.data, (number[matrix.row], number[matrix.col])), shape=matrix.shape)

    return Reference(
        degree=degree, knots=knots, n=int(basis.N), dofs=number[basis.element_dofs].T.copy(),
        forces=tabulated(of_forces), inertia=tabulated(basis),
        M=operator(mass_form), G=operator(transport_form), H=operator(convection_form),
        shapes=shape_polynomials(lagrange_element(degree)),
    )  # fmt: skip


def graded_knots(elements: int, grading: float, fine_at_end: bool) -> Array:
    """Return knots on [0, 1] with geometric element lengths; largest over smallest = grading."""
    lengths = np.geomspace(1.0, grading, elements) if elements > 1 else np.ones(1)
    if fine_at_end:
        lengths = lengths[::-1]
    knots = np.concatenate([[0.0], np.cumsum(lengths)])
    knots /= knots[-1]
    return knots
