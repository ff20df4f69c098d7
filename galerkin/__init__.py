"""The Galerkin solver, the paper's side: equations (17)-(32) over sines or wavelets, also with a travelling kink."""

from galerkin.abscissa import PositionAbscissa
from galerkin.bases import Basis, Daubechies, Fourier
from galerkin.equations import GalerkinSystem
from galerkin.modes import bare_frequencies
from galerkin.rides import RollingSystem

__all__ = ["Basis", "Daubechies", "Fourier", "GalerkinSystem", "PositionAbscissa", "RollingSystem", "bare_frequencies"]
