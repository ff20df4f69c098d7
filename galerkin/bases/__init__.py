"""Functions phi_1 .. phi_n on [0, 1] that vanish at both ends."""

from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier

Basis = Fourier | Daubechies
