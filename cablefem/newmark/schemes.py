import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Scheme:
    """Newmark (1959), generalised-alpha or collocation.

    alpha_m, alpha_f : the balance uses a at 1 - alpha_m and t, q, v at 1 - alpha_f of the step (Chung & Hulbert 1993).
    nodes : in units of the step (Hairer & Wanner 1996, section IV.5).
    """

    name: str
    newmark_beta: float = 0.25
    newmark_gamma: float = 0.5
    alpha_m: float = 0.0
    alpha_f: float = 0.0
    nodes: tuple[float, ...] = ()

    @property
    def implicit(self) -> bool:
        return self.newmark_beta > 0.0

    @property
    def damps(self) -> bool:
        return self.nodes[-1] == 1.0 if self.nodes else self.newmark_gamma > 0.5

    @property
    def order(self) -> int:
        if self.nodes:
            return 2 * len(self.nodes) - (self.nodes[-1] == 1.0)
        return 2 if abs(self.newmark_gamma - 0.5 + self.alpha_m - self.alpha_f) < 1e-12 else 1


SCHEMES = ("trapezoidal", "newmark", "generalized-alpha", "radau", "gauss", "central-difference")
RADAU = ((4.0 - math.sqrt(6.0)) / 10.0, (4.0 + math.sqrt(6.0)) / 10.0, 1.0)
GAUSS = ((3.0 - math.sqrt(3.0)) / 6.0, (3.0 + math.sqrt(3.0)) / 6.0)


def scheme(name: str, *, newmark_gamma: float = 0.6, rho_inf: float = 0.9) -> Scheme:
    """A scheme by name.

    trapezoidal        second order; unconditionally stable for linear systems.
    newmark            first order, damped.
    generalized-alpha  second order, spectral radius rho_inf at infinite frequency.
    radau              fifth order, L-stable.
    gauss              fourth order, keeps quadratic energies.
    central-difference second order; stable for dt < 2/omega_max.
    """
    match name:
        case "trapezoidal":
            return Scheme(name)
        case "newmark":
            return Scheme(name, 0.25 * (newmark_gamma + 0.5) ** 2, newmark_gamma)
        case "generalized-alpha":
            alpha_m = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0)
            alpha_f = rho_inf / (rho_inf + 1.0)
            a = alpha_m - alpha_f
            return Scheme(name, 0.25 * (1.0 - a) ** 2, 0.5 - a, alpha_m, alpha_f)
        case "radau":
            return Scheme(name, nodes=RADAU)
        case "gauss":
            return Scheme(name, nodes=GAUSS)
        case "central-difference":
            return Scheme(name, newmark_beta=0.0)
    raise ValueError(f"unknown scheme {name!r}; one of {', '.join(SCHEMES)}")
