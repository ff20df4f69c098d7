"""A line at rest, by Newton's method from chords with a little sag; a stiff rope begins soft."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cablefem.newmark import StepFailure
from cablefem.scene.contacts import Array, Contact, MovingLine
from cablefem.scene.line import NoLineAtRest
from cablefem.scene.taut import first_guess
from galerkin.bodies import Friction
from galerkin.trolley import vectors_from_turned_axes

if TYPE_CHECKING:
    from galerkin.lines import LineSines

SAG = 0.03  # of the first guess, over the chord, of a rope that is not longer than its chords
ITERATIONS = 100  # of the search for rest
TOL = 1e-11  # of EA
SOFTENED = 4  # steps from a soft rope to the stiff one


def coordinates_at_rest(system: LineSines, time_shift: float = 0.0, guess: Array | None = None) -> Array:
    """Coordinates (3, layout.size) of the line at rest, free cars held; F stands in the last row.

    time_shift : [s] by which the prescribed positions are ahead of the start, at their first speed.
    guess : coordinates near by, else several are tried.
    StepFailure where no rest is found.
    """
    layout = system.layout
    Z = system.prescribed_coordinates(0.0, 0)
    Z[0] += time_shift * Z[1]
    Z[1] = 0.0
    for k in system.free_cars:
        Z[2, layout.F[k]] = 0.0
    Z[2, layout.s] = Z[2, layout.x] = 0.0
    search = RestSearch(system, Z)
    if guess is not None:
        return search.solve(guess)
    begin = guess_sagging_chords(system, search.Z)
    tension = _guess_mean_tension(system, begin)
    for factor in (1.0, 4.0, 0.25):
        try:
            rest = _rest_by_stiffening_rope(search, begin, factor * tension)
        except StepFailure:
            continue
        if search.is_taut(rest):
            return rest
    raise StepFailure(0.0, "no rest of the line was found", "start the cars elsewhere")


def _rest_by_stiffening_rope(search: RestSearch, guess: Array, tension: float) -> Array:
    """Rest of a rope that at first resists little to changes of this tension [N]."""
    rest = guess
    soft = min(1.0, 5.0 * tension / search.system.line.rope.EA)
    for fraction in np.geomspace(soft, 1.0, SOFTENED + 1).tolist():
        search.soften_rope(tension, fraction)
        rest = search.solve(rest)
    return rest


def chord_lengths(line: MovingLine) -> Array:
    """Distances [m] between neighbouring supports."""
    points = np.array([c.point for c in line.supports])
    return np.asarray(np.hypot(*np.diff(points, axis=0).T))


def _guess_mean_tension(system: LineSines, guess: Array) -> float:
    """Mean tension [N] of a taut string with the cars at the points of a guess; StepFailure if none carries them."""
    line = system.line
    x = guess[0, system.layout.x].tolist()
    cars_at_x = ((body.car, x[system.travel_contact[k]]) for k, body in system.cars.items())
    string = first_guess(line.rest_case(cars_at_x))
    if isinstance(string, NoLineAtRest):
        raise StepFailure(0.0, str(string), "give more rope or less load")
    return float(string.H.mean())


class RestSearch:
    """Newton's method for the rest of a line with what is prescribed in Z, free cars held."""

    def __init__(self, system: LineSines, Z: Array) -> None:
        self.system = system
        self.equations = system.held_equations
        self.Z = Z
        self.frictions = np.zeros((1, len(self.equations.bodies), len(Friction._fields)))
        for k, body in system.cars.items():
            if body.car.travel is not None:
                sign = system.line.travel_direction(body.car, 0)
                self.frictions[0, k] = Friction(body.car.drive.mu_r, sign=sign)

    def soften_rope(self, tension: float, fraction: float) -> None:
        """Let the rope resist changes of this tension [N] with a fraction of its stiffness."""
        EA = fraction * self.system.line.rope.EA
        self.equations.line = self.equations.line._replace(EA=EA, N=(1.0 - fraction) * tension)

    def coordinates(self, unknowns: Array) -> Array:
        """All coordinates (3, layout.size) with these unknowns."""
        free = self.equations.free
        forces = self.equations.forces
        Z = self.Z.copy()
        Z[0, free] = np.where(forces, 0.0, unknowns)
        self.system.layout.set_dependent_coordinates(Z)
        Z[2, free[forces]] = unknowns[forces]
        return Z

    def residual_norm(self, unknowns: Array) -> float:
        """|r|; infinite where contacts are not in their order along the rope."""
        Z = self.coordinates(unknowns)
        if not (np.diff(Z[0, self.system.layout.s]) > 0.0).all():
            return math.inf
        r = self.equations.evaluate(Z[:, None], self.frictions).r
        return float(np.linalg.norm(r))

    def is_taut(self, rest: Array) -> bool:
        """Whether no tension is negative: a rope that stands on its saddles, compressed, balances its loads, too."""
        values = self.equations.evaluate(rest[:, None], self.frictions)
        return bool(self.system.min_tension_and_saddle_pressures(values)[0, 0] > 0.0)

    def solve(self, guess: Array) -> Array:
        """Coordinates at rest, with shorter steps where the residual grows; StepFailure without convergence."""
        free = self.equations.free
        forces = self.equations.forces
        unknowns = np.where(forces, guess[2, free], guess[0, free])
        before = math.inf
        bound = TOL * self.system.line.rope.EA
        for _ in range(ITERATIONS):
            Z = self.coordinates(unknowns)[:, None]
            values, K = self.equations.evaluate_with_derivatives(Z, self.frictions)
            r = values.r[0]
            step = np.linalg.solve(np.where(forces, K[2], K[0]), r)
            now = float(np.linalg.norm(r))
            if now <= bound and now >= 0.5 * before:
                return self.coordinates(unknowns)
            fraction = 1.0
            while self.residual_norm(unknowns - fraction * step) > now and now > bound and fraction > 1e-6:
                fraction *= 0.5
            unknowns = unknowns - fraction * step
            before = now
        raise StepFailure(0.0, "no rest of the line was found", "start the cars elsewhere")


class Chord(NamedTuple):
    """The first guess between two supports: a chord with a little sag."""

    s: Array  # of both supports (2,) [m]
    start: Array  # point of the first (2,)
    direction: Array  # to the second (2,)
    sag: float  # [m] four times that at the middle

    def y_at_fraction(self, fraction: float) -> float:
        """y at a fraction of the chord."""
        straight = self.start[1] + fraction * self.direction[1]
        return float(straight + self.sag * fraction * (1.0 - fraction))


def guess_sagging_chords(system: LineSines, Z: Array) -> Array:
    """Coordinates (3, layout.size) with contacts on chords that sag a little; Z holds what is prescribed."""
    line = system.line
    layout = system.layout
    Z = Z.copy()
    supports = [k for k, c in enumerate(line.contacts_and_wheels) if isinstance(c, Contact)]
    distances = np.concatenate([[0.0], np.cumsum(chord_lengths(line))])  # of supports along the chords
    sags = 4.0 * _guess_sag_ratio(line, distances[-1]) * np.diff(distances)
    Z[0, layout.s[supports]] = _guess_support_positions(line, distances)
    points = np.array([c.point for c in line.supports])
    for k in system.cars:
        i = int(np.searchsorted(supports, k)) - 1
        s = Z[0, layout.s[supports[i : i + 2]]]
        chord = Chord(s, points[i], points[i + 1] - points[i], sags[i])
        _set_car_on_chord(system, k, chord, Z)
    return Z


def _guess_sag_ratio(line: MovingLine, chords: float) -> float:
    """Sag over chord: of a parabola as long as the rope between two fixed ends; chords : [m] sum of their lengths."""
    if line.rope.length is None or "counterweight" in (c.kind for c in line.supports):
        return SAG
    excess = line.rope.length / chords - 1.0
    return max(SAG, math.sqrt(0.375 * max(0.0, excess)))


def _guess_support_positions(line: MovingLine, distances: Array) -> Array:
    """s of the supports: the rope is spread over the chords evenly."""
    kinds = [c.kind for c in line.supports]
    length = line.rope.length or 0.0
    begin = 0.0
    end = distances[-1]
    if "counterweight" not in kinds:
        end = length
    elif kinds[0] == "counterweight":
        begin = length - distances[-1]
        end = length
    return np.asarray(begin + (end - begin) * distances / distances[-1])


def _set_car_on_chord(system: LineSines, k: int, chord: Chord, Z: Array) -> None:
    """Set the contacts of a car in Z: by its x, or by its s."""
    layout = system.layout
    front = system.travel_contact[k]
    s, x, y = layout.s[front], layout.x[front], layout.y[front]
    s_0, s_1 = chord.s
    if system.cars[k].car.drive_mode_or_haul_x == "haul_x":
        fraction = (Z[0, x] - chord.start[0]) / chord.direction[0]
        Z[0, s] = s_0 + fraction * (s_1 - s_0)
    else:
        fraction = (Z[0, s] - s_0) / (s_1 - s_0)
        Z[0, x] = chord.start[0] + fraction * chord.direction[0]
    Z[0, y] = chord.y_at_fraction(fraction)
    if front > k:
        wheel = layout.wheels[front]
        base = wheel.arm[0] - layout.wheels[k].arm[0]
        Z[0, layout.s[k]] = Z[0, layout.s[front]] - base
        dx, dy = chord.direction
        Z[0, wheel.pitch] = math.atan2(dy, dx)
        Z[0, wheel.c] = Z[0, wheel.p] - vectors_from_turned_axes(wheel.arm, Z[0, wheel.pitch, None])
