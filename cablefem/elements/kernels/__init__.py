"""Compiled inner loops of the cable elements.

The forces are those of `forms`, which says what they are; here is how they are summed fast, from tables that scikit-fem
filled on the reference meshes.  A step of these small systems costs more in interpreter than in arithmetic otherwise.

    law       the constitutive law
    balance   cable and a mass whose place is given
    car       cable and a car that rolls
    banded    the linear algebra of both
    newton    a step of Newmark's family;  collocation, one of collocation
    observe   what is seen of a state

Common arguments
    q, v, a   (n_dof,)  unknowns, field index running fastest: dof * n_fields + field
    mesh      `balance.Mesh`
    cable     (alpha, sigma, c, law) of the full cable, see `law.tension`, or `balance.add_chord`'s
    ab        (n_dof, 3 b + 1) rows of a matrix of half-width b: ab[i, b + j - i] = A[i, j]; the last b columns are
              empty until rows are exchanged
"""

from cablefem.compiled import compiler

compiled = compiler(__file__)
