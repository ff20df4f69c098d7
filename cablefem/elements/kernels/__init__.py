"""Compiled inner loops of the cable elements; `forms` says what they sum.

- law: the constitutive law
- balance: cable and a mass at a given place
- car: the row of a car that rolls
- banded: factors of a banded matrix
- newton, collocation: steps
- observe: sums over a history

Unknowns (n_dof,) have the field index running fastest: dof * n_fields + field.  Branches for an
argument that is None are not compiled; a function must ask for its own arguments only.
"""

from cablefem.compiled import compiler

compiled = compiler(__file__)
