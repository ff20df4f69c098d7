"""Reference meshes, tabulated by scikit-fem."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from skfem.models.poisson import mass

from cablefem.newmark import Array


def lagrange_element(degree: int) -> skfem.Element:
    """A new 1D element; a reused ElementLinePp returns values at earlier points (scikit-fem 12.0.2)."""
    if degree == 1:
        return skfem.ElementLineP1()
    if degree == 2:
        return skfem.ElementLineP2()
    return skfem.ElementLinePp(degree)


def shape_polynomials(element: skfem.Element) -> Array:
    """P (n_loc, n_loc): shape function k on [0, 1] is sum_m P[k, m] x^m."""
    n_loc = element.refdom.nnodes * element.nodal_dofs + element.interior_dofs
    x = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_loc) + 0.5) / n_loc)
    mesh = skfem.MeshLine(np.array([0.0, 1.0]))
    basis = skfem.Basis(mesh, element, quadrature=(x[None, :], np.ones(n_loc)))
    values = np.array([np.asarray(basis.basis[k][0])[0] for k in range(n_loc)])
    return np.linalg.solve(np.vander(x, increasing=True), values.T).T


@skfem.BilinearForm
def transport_form(phi, eta, w):
    """chi : mesh velocity over ds_o."""
    return w["chi"] * eta * phi.grad[0]


@skfem.BilinearForm
def convection_form(phi, eta, w):
    return w["chi"] ** 2 * eta.grad[0] * phi.grad[0]


def force_order(degree: int, damped: bool = False) -> int:
    """Order of quadrature of internal forces: as many Gauss points as the degree, at least two.

    More points lock (Stolarski & Belytschko 1982): u' cannot follow v'^2/2.
    Internal damping takes two more: a slack cable wrinkles between fewer.
    """
    return max(2, 2 * degree - 1) + 4 * damped


def tabulated(basis: skfem.Basis) -> Array:
    """x, weights, shape values and slopes, (n_el, n_q, 2 + 2 n_loc)."""
    x = np.asarray(basis.global_coordinates())[0]
    fields = [basis.basis[k][0] for k in range(basis.Nbfun)]
    columns = [x, basis.dx, *(f.get(0) for f in fields), *(f.grad[0] for f in fields)]
    return np.stack([np.broadcast_to(np.asarray(column), x.shape) for column in columns], axis=2)


class Reference(NamedTuple):
    """Both sides of the mass, which is at x = 0: xi = 1 + x behind it, xi = x ahead of it.

    Unknowns are numbered along the cable, without those at the supports.
    """

    degree: int
    knots: Array  # (2 elements + 1,) x
    node: int  # unknown of the mass
    dofs: NDArray[np.int64]  # (n_el, n_loc), -1 on a support
    forces: Array  # xi and the rest of `tabulated`, at the points of `force_order`
    operators: Array  # (8, 2 degree + 1, n) `bands` of M^, G^, G^T and H^, each behind and ahead
    moments: Array  # (2, n, 4) of each side, see `moments`
    shapes: Array  # see `shape_polynomials`


def along(basis: skfem.Basis, degree: int) -> NDArray[np.int64]:
    """Numbers along the mesh for scikit-fem's unknowns."""
    number = np.empty(basis.N, dtype=np.int64)
    inside = np.r_[0, degree, 1:degree]  # an element's nodes come first
    number[basis.element_dofs] = inside[:, None] + degree * np.arange(basis.element_dofs.shape[1])
    return number


def bands(data: Array, row: NDArray[np.integer], col: NDArray[np.integer], n: int, b: int) -> Array:
    """Diagonals, bands[b + j - i, i] = matrix[i, j], |i - j| <= b, of n unknowns; numbers below 0 are supports."""
    inner = (row >= 0) & (col >= 0)
    data, row, col, out = data[inner], row[inner], col[inner], np.zeros((2 * b + 1, n))
    np.add.at(out, (b + col - row, row), data)
    return out


def moments(dofs: NDArray[np.int64], tab: Array, chi: Array, n: int) -> Array:
    """int phi, int chi phi, int chi phi,xi and int chi^2 phi,xi dxi of n functions, (n, 4)."""
    n_loc = dofs.shape[1]
    phi, phi_x = tab[..., 2 : 2 + n_loc], tab[..., 2 + n_loc :]
    out = np.zeros((n + 1, 4))  # last row: supports
    for k, (function, power) in enumerate(((phi, 0), (phi, 1), (phi_x, 1), (phi_x, 2))):
        np.add.at(out[:, k], dofs, np.einsum("eg,egk->ek", tab[..., 1] * chi**power, function))
    return out[:-1]


@lru_cache(maxsize=64)
def reference(elements: int, degree: int, grading: float, damped: bool = False) -> Reference:
    """Equal or graded elements on both sides; grading: longest over shortest, next to the mass."""
    lengths = np.geomspace(1.0, grading, elements) if elements > 1 else np.ones(1)
    ahead = np.append(0.0, np.cumsum(lengths))
    ahead /= ahead[-1]
    knots = np.concatenate([-ahead[:0:-1], ahead])
    mesh, sides = skfem.MeshLine(knots), (slice(0, elements), slice(elements, None))
    basis, of_forces = (
        skfem.Basis(mesh, lagrange_element(degree), intorder=order)
        for order in (2 * degree, force_order(degree, damped))
    )
    number = along(basis, degree) - 1
    n = int(basis.N) - 2
    number[number == n] = -1

    parts = [
        skfem.Basis(mesh, lagrange_element(degree), intorder=2 * degree, elements=np.arange(2 * elements)[x])
        for x in sides
    ]

    def operator(form: skfem.BilinearForm, part: skfem.Basis) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
        whole = form.assemble(part, chi=1.0 - abs(np.asarray(part.global_coordinates())[0])).tocoo()
        return whole.data, number[whole.row], number[whole.col]

    M, G, H = ([operator(form, part) for part in parts] for form in (mass, transport_form, convection_form))
    dofs, forces, inertia = number[basis.element_dofs].T.copy(), tabulated(of_forces), tabulated(basis)
    of_sides = np.array([moments(dofs[x], inertia[x], 1.0 - abs(inertia[x][..., 0]), n) for x in sides])
    forces[:elements, :, 0] += 1.0
    return Reference(
        degree, knots, elements * degree - 1, dofs, forces,
        np.array([bands(*x, n, degree) for x in (*M, *G, *((data, j, i) for data, i, j in G), *H)]), of_sides,
        shape_polynomials(lagrange_element(degree)),
    )  # fmt: skip
