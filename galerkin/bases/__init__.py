"""Global bases on the cable: functions phi_1 .. phi_n of s/l on [0, 1] that vanish at both ends."""

from galerkin.bases.daubechies import Daubechies
from galerkin.bases.fourier import Fourier

Basis = Fourier | Daubechies
