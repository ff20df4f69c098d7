"""Compiled inner loops of the cable elements; `forms` has their integrals.

- law: the constitutive law
- balance: cable and a mass at a given place
- car: the row of a car that rolls
- banded: factors of a banded matrix
- newton, collocation: steps
- observe: sums over a history

Unknowns (n_dof,) are numbered dof * n_fields + field.
numba leaves out branches for an argument that is None, if the function tests its own arguments only.
"""

from cablefem.compiled import compiler

compiled = compiler(__file__)
