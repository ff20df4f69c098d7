"""Compiled inner loops of the cable elements; `forms` has their integrals.

Unknowns (n_dof,) are numbered dof * n_fields + field.
numba leaves out branches for an argument that is None, if the function tests its own arguments only.
"""

from cablefem.compiled import compiling_decorator

compiled = compiling_decorator(__file__)
inner = compiling_decorator(__file__, inner=True)
shared = compiling_decorator(__file__, inner=True, shared=True)
