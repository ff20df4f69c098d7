"""The Galerkin solver, the paper's side; see README.md."""

from galerkin.abscissa import SystemOverPosition
from galerkin.bases import Basis, Daubechies, Fourier
from galerkin.equations import GalerkinSystem
from galerkin.lines import LineSines
from galerkin.modes import scaled_frequencies
from galerkin.rides import RollingSystem
