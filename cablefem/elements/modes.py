"""Frequencies of the bare cable by scikit-fem, independent of the time loop's tangent.

    u_tt = [ T u' + (alpha - T)(x'u' + y'v') x' ]',   v_tt = [ T v' + (alpha - T)(x'u' + y'v') y' ]'

Dimensionless: l = H = rho = 1.
"""

import numpy as np
import skfem
from scipy.linalg import eigh
from scipy.sparse import block_array, csr_array
from skfem.models.poisson import mass

from cablefem.elements.cable import STRETCHING
from cablefem.elements.reference import lagrange_element
from cablefem.newmark import Array
from cablefem.scene import Groups


@skfem.BilinearForm
def tension_form(phi, eta, w):
    return w["N"] * phi.grad[0] * eta.grad[0]


@skfem.LinearForm
def slope_times_test_gradient_form(eta, w):
    return w["slope"] * eta.grad[0]


def scaled_frequencies(
    groups: Groups, *, elements: int = 10, degree: int = 8, model: str = "full", n: int | None = 10
) -> Array:
    """The n lowest circular frequencies of the bare cable, omega l sqrt(rho/H), ascending, (n,); None: all.

    elements : on the whole cable; degree : 1 to 8.
    model : "full", "string", "sagged" (Irvine & Caughey's theory), or "stretching", at rest the same.
    """
    mesh = skfem.MeshLine(np.linspace(0.0, 1.0, elements + 1))
    basis = skfem.Basis(mesh, lagrange_element(degree), intorder=2 * degree + 2)
    s = np.asarray(basis.global_coordinates())[0]
    inner = basis.complement_dofs(basis.get_dofs())

    def stiffness(N: Array) -> Array:
        return tension_form.assemble(basis, N=N)[np.ix_(inner, inner)]

    M = mass.assemble(basis)[np.ix_(inner, inner)]
    if model == "full":
        T, xp, yp = groups.tension_and_slope(s)
        axial = groups.alpha - T
        of_u = stiffness(T + axial * xp * xp)
        of_v = stiffness(T + axial * yp * yp)
        coupling = stiffness(axial * xp * yp)
        K = block_array([[of_u, coupling], [coupling, of_v]])
        M = block_array([[M, None], [None, M]])
    else:
        T_chord = 1.0 / groups.chord_cos
        slope = groups.sigma * groups.chord_cos / T_chord * (0.5 - s)
        sag = slope_times_test_gradient_form.assemble(basis, slope=slope)[inner]
        stretching = STRETCHING[model][0] * groups.alpha * csr_array(np.outer(sag, sag))
        K = stiffness(np.full_like(s, T_chord)) + stretching
    return np.sqrt(eigh(K.toarray(), M.toarray(), eigvals_only=True)[:n])
