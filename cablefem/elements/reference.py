"""Reference meshes, tabulated by scikit-fem."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csr_array
from skfem.models.poisson import mass

from cablefem.newmark import Array


def lagrange_element(degree: int) -> skfem.Element:
    """A new 1D element; a reused ElementLinePp returns values at earlier points (scikit-fem 12.0.2)."""
    if degree == 1:
        return skfem.ElementLineP1()
    if degree == 2:
        return skfem.ElementLineP2()
    return skfem.ElementLinePp(degree)


def shape_polynomial_coefficients(element: skfem.Element) -> Array:
    """P (n_loc, n_loc): shape function k on [0, 1] is sum_m P[k, m] x^m."""
    n_loc = element.refdom.nnodes * element.nodal_dofs + element.interior_dofs
    angles = np.pi * (np.arange(n_loc) + 0.5) / n_loc
    x = 0.5 - 0.5 * np.cos(angles)
    mesh = skfem.MeshLine(np.array([0.0, 1.0]))
    basis = skfem.Basis(mesh, element, quadrature=(x[None, :], np.ones(n_loc)))
    values = np.array([np.asarray(basis.basis[k][0])[0] for k in range(n_loc)])
    return np.linalg.solve(np.vander(x, increasing=True), values.T).T


@skfem.BilinearForm
def transport_form(phi, eta, w):
    """chi : mesh velocity over ds_o."""
    return w["chi"] * eta * phi.grad[0]


@skfem.BilinearForm
def convective_stiffness_form(phi, eta, w):
    return w["chi"] ** 2 * eta.grad[0] * phi.grad[0]


def force_quadrature_order(degree: int) -> int:
    """Order of quadrature of internal forces: as many Gauss points as the degree, at least two.

    More points lock (Stolarski & Belytschko 1982): u' cannot follow v'^2/2.
    """
    return max(2, 2 * degree - 1)


def shape_table(basis: skfem.Basis) -> Array:
    """x, weights, shape values and slopes, (n_el, n_q, 2 + 2 n_loc)."""
    x = np.asarray(basis.global_coordinates())[0]
    fields = [basis.basis[k][0] for k in range(basis.Nbfun)]
    values = [field.get(0) for field in fields]
    slopes = [field.grad[0] for field in fields]
    columns = [x, basis.dx, *values, *slopes]
    of_all_points = [np.broadcast_to(np.asarray(column), x.shape) for column in columns]
    return np.stack(of_all_points, axis=2)


class QuadraturePoints(NamedTuple):
    """Points of quadrature of all elements, p, and matrices (p, n) from unknowns to values and slopes there."""

    x: Array  # (p, 1)
    weights: Array  # (p, 1)
    behind: NDArray[np.bool_]  # (p, 1) the mass
    values: csr_array
    slopes: csr_array  # d/dx

    @classmethod
    def from_table(cls, dofs: NDArray[np.int64], tab: Array, n_left: int, n: int) -> QuadraturePoints:
        """dofs : (n_el, n_loc) of n unknowns, -1 on a support;  tab : see `shape_table`;  n_left : elements behind."""
        n_el, n_q, _ = tab.shape
        n_loc = dofs.shape[1]
        column = np.repeat(dofs, n_q, axis=0)  # (p, n_loc)
        inner = column >= 0
        first = np.append(0, np.cumsum(inner.sum(axis=1)))  # entry of each row
        of_points = tab.reshape(n_el * n_q, -1)
        x, weights, values, slopes = np.split(of_points, [1, 2, 2 + n_loc], axis=1)

        def matrix(functions: Array) -> csr_array:
            return csr_array((functions[inner], column[inner], first), shape=(n_el * n_q, n))

        behind = np.arange(n_el * n_q)[:, None] < n_left * n_q
        return cls(x, weights, behind, matrix(values), matrix(slopes))


class ReferenceMesh(NamedTuple):
    """Both sides of the mass, which is at x = 0: xi = 1 + x behind it, xi = x ahead of it.

    Unknowns are numbered along the cable, without those at the supports.
    """

    degree: int
    knots: Array  # (2 elements + 1,) x
    node: int  # unknown of the mass
    dofs: NDArray[np.int64]  # (n_el, n_loc), -1 on a support
    forces: Array  # xi and the rest of `shape_table`, at the points of `force_quadrature_order`
    at_force: QuadraturePoints  # those of `forces`
    at_inertia: QuadraturePoints  # that integrate products of two shapes
    operators: Array  # (8, 2 degree + 1, n) `assemble_bands` of M^, G^, G^T and H^, each behind and ahead
    moments: Array  # (2, n, 4) of each side, see `shape_integrals`
    shapes: Array  # see `shape_polynomial_coefficients`


def element_unknowns(degree: int, n_el: int) -> NDArray[np.int64]:
    """Unknowns of each element in scikit-fem's order, numbered along the mesh, (n_el, n_loc)."""
    of_first = np.r_[0, degree, 1:degree]  # an element's nodes come first
    return of_first + degree * np.arange(n_el)[:, None]


def assemble_bands(local_matrices: Array, dofs: NDArray[np.int64], n: int, b: int) -> Array:
    """Diagonals, bands[b + j - i, i] = matrix[i, j], |i - j| <= b, of n unknowns, from (n_el, n_loc, n_loc)."""
    row, col = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    inner = (row >= 0) & (col >= 0)
    out = np.zeros((2 * b + 1, n))
    diagonal = b + col - row
    np.add.at(out, (diagonal[inner], row[inner]), local_matrices[inner])
    return out


def shape_integrals(dofs: NDArray[np.int64], tab: Array, chi: Array, n: int) -> Array:
    """int phi, int chi phi, int chi phi,xi and int chi^2 phi,xi dxi of n functions, (n, 4)."""
    n_loc = dofs.shape[1]
    phi = tab[..., 2 : 2 + n_loc]
    phi_x = tab[..., 2 + n_loc :]
    out = np.zeros((n + 1, 4))  # last row: supports
    integrands = [(phi, 0), (phi, 1), (phi_x, 1), (phi_x, 2)]  # function, and power of chi
    for k, (function, power) in enumerate(integrands):
        of_elements = np.einsum("eg,egk->ek", tab[..., 1] * chi**power, function)
        np.add.at(out[:, k], dofs, of_elements)
    return out[:-1]


@lru_cache(maxsize=64)
def reference_mesh(elements: int, degree: int, grading: float) -> ReferenceMesh:
    """Equal or graded elements on both sides; grading: longest over shortest, next to the mass."""
    lengths = np.geomspace(1.0, grading, elements) if elements > 1 else np.ones(1)
    ahead = np.append(0.0, np.cumsum(lengths))
    ahead /= ahead[-1]
    knots = np.concatenate([-ahead[:0:-1], ahead])
    mesh = skfem.MeshLine(knots)
    of_products = skfem.Basis(mesh, lagrange_element(degree), intorder=2 * degree)
    of_forces = skfem.Basis(mesh, lagrange_element(degree), intorder=force_quadrature_order(degree))
    dofs = element_unknowns(degree, 2 * elements) - 1
    n = 2 * elements * degree - 1
    dofs[dofs == n] = -1
    chi = 1.0 - abs(np.asarray(of_products.global_coordinates())[0])
    # local matrices: trial functions come first
    forms = mass, transport_form, convective_stiffness_form
    M, GT, H = (form.coo_data(of_products, chi=chi).tolocal() for form in forms)
    forces = shape_table(of_forces)
    inertia = shape_table(of_products)
    operators = []
    moments = []
    sides = [slice(0, elements), slice(elements, None)]
    for local in (M, GT.swapaxes(1, 2), GT, H):
        operators += [assemble_bands(local[side], dofs[side], n, degree) for side in sides]
    for side in sides:
        moments.append(shape_integrals(dofs[side], inertia[side], chi[side], n))
    for tab in (forces, inertia):
        tab[:elements, :, 0] += 1.0
    return ReferenceMesh(
        degree=degree,
        knots=knots,
        node=elements * degree - 1,
        dofs=dofs,
        forces=forces,
        at_force=QuadraturePoints.from_table(dofs, forces, elements, n),
        at_inertia=QuadraturePoints.from_table(dofs, inertia, elements, n),
        operators=np.array(operators),
        moments=np.array(moments),
        shapes=shape_polynomial_coefficients(lagrange_element(degree)),
    )
