"""Elements that gather around the front which a light car sends out as it enters.

A car of mass mu that enters with speed falls until the cable carries it, and what the cable hears of that is a front of
width mu.  Both supports throw it back, and it meets the car again: as sharp as the mesh has kept it.  Nodes of a
following mesh see it pass within mu, and elements and steps everywhere must be smaller than that.  Here they travel
with it: along both sides of the mass s(xi, t) has equal parts of

    W = s + sum_j 1/(1 + exp(-(s - y_j)/p)),   y_j the front, its mirror images in the ends of the side, and the car,

p about the car's mass.  y runs along a polyline with rounded corners: to and fro between the support and the car at the
speed of a wave on the cable at rest (what the car adds to it is of the order of mu, too); while the front is on the
other side, with what the car has thrown back of it, or else it waits at the car.  Steps are short where a front meets
something.  On `level` with mu = 0.01, V/c = 0.41 path errors of Radau are 2.0e-4 with 30 elements a side and 244 steps;
of a following mesh 2.1e-3 with 100 and 488, 2.4e-4 with 320 and 976, at 20 times the time.

Any motion of the nodes gives the same equations, `kernels.front.weigh`: that of the front need not be known well.
"""

import numpy as np
from scipy.linalg import solveh_banded

from cablefem.elements.cable import CableElements
from cablefem.elements.following import FollowingElements
from cablefem.elements.kernels.front import follow_fronts, weigh
from cablefem.newmark import NO_STEPS, Array, Newton, Settled
from cablefem.response import States
from cablefem.scene import Groups, Motion

WIDTH, LEAST = 1.5, 3e-3  # p over mu, and at least of the length
SHORT = 6.0  # p: on a shorter way to the support and back nothing is followed
BEFORE, AFTER = 2.0, 4.0  # p around a meeting, in time, where steps are short
SHORTER = 4.0
SAMPLES = 20_001


class FrontElements(FollowingElements):
    """The cable with its moving mass on elements that travel with the front of its entry; else as `FollowingElements`.

    Accelerations at entry are those of nodes that lie where the front begins.
    """

    def __init__(self, groups: Groups, **kind: object) -> None:
        self._width = WIDTH * max(groups.mu, LEAST)
        super().__init__(groups, **kind)  # type: ignore[arg-type]
        T = groups.static(np.linspace(0.0, 1.0, 101))[0]
        self._lines = lines(self.motion, 1.0 / float(np.mean(1.0 / np.sqrt(T))), SHORT * self._width)
        self._xi = np.stack([self.left.knots, self.right.knots])
        self._seen: tuple[Array | None, Array] = None, np.empty(0)
        self._weigh(0.0, np.array(self.motion.at(0.0, 0)))
        f, m, b = self.fields, self.node, self.left.degree
        M = self._operators[0, b:, ::f][:, m:]  # ahead of the mass, with M x = e at the mass
        pushed = solveh_banded(M, np.eye(M.shape[1], 1)[:, 0], lower=True)
        self._ride = np.concatenate([self._ride[:m], pushed / pushed[0]])
        self._entrained = float(1.0 / pushed[0])

    def pace(self) -> tuple[Array, Array]:
        end = self.motion.phases[-1][1]
        met = np.unique(np.concatenate([line[:-1, 0] for line in self._lines]))
        around = np.clip(met[:, None] + self._width * np.array([-BEFORE, AFTER]), 0.0, end)
        t = np.unique(np.concatenate([[0.0, end], around.ravel()]))
        middle = 0.5 * (t[1:] + t[:-1])
        short = ((around[:, :1] < middle) & (middle < around[:, 1:])).any(axis=0)
        return t, np.concatenate([[0.0], np.cumsum(np.diff(t) * np.where(short, SHORTER, 1.0))])

    def _fresh(self) -> None:
        super()._fresh()
        self._operators, self._coefficients = np.empty_like(self._bands), np.eye(3)

    def _time(self, t: float, phase: int) -> None:
        """Set M, C and K themselves at this instant."""
        at = np.array(self.motion.at(t, phase))
        if not 0.0 < at[0] < 1.0:
            raise ValueError(f"s_o = {at[0]!r}: a side of the following mesh has no length")
        self._weigh(t, at)
        self._contact.load[:] = self._load(*at.tolist())

    def _weigh(self, t: float, at: Array) -> None:
        follow_fronts(self._xi, self._lines, self._width, np.array([t]), at[None], self._mesh.span[None])
        weigh(self._mesh.span, self._dofs, self._fine, self.fields, self._operators)

    def stride(self, *step: object) -> tuple[Array, Array]:
        """Take no steps in one go."""
        return NO_STEPS

    def settle(
        self, t: float, phase: int, start: Array, now: Array, rule: Array, bound: float, newton: Newton
    ) -> Settled:
        return CableElements.settle(self, t, phase, start, now, rule, bound, newton)

    def _fronts(self, instants: Array) -> tuple[Array, tuple[Array, Array], float, Array, Array]:
        return self._xi, self._lines, self._width, instants, self._fine

    def _spans(self, states: States, kinematics: Array) -> Array:
        if self._seen[0] is not states.t:
            spans = np.empty((states.t.size, *self._mesh.span.shape))
            follow_fronts(self._xi, self._lines, self._width, states.t, kinematics, spans)
            self._seen = states.t, spans
        return self._seen[1]

    def _beside(self, states: States, kinematics: Array) -> tuple[Array, Array]:
        spans = self._spans(states, kinematics)
        return spans[:, self._n_left - 1, 1], spans[:, self._n_left, 1]


def lines(motion: Motion, speed: float, least: float) -> tuple[Array, Array]:
    """Return corners (m, 2), times and places, of what is followed on the left and the right side of the mass.

    speed : of the front;  least : no shorter way from the car to the support and back is followed.
    """
    end = motion.phases[-1][1]
    t = np.linspace(0.0, end, SAMPLES)
    s_o = motion.position(t)

    def place(t: float) -> float:
        return float(motion.position(t))

    def trip(begin: float, side: int) -> list[tuple[float, float]]:
        """Return the corners of a way from the car to the support and back, or on beyond the end of the travel."""
        turn, sign = begin + abs(side - place(begin)) / speed, 1.0 - 2.0 * side
        met = (t > turn) & (sign * (side + sign * speed * (t - turn) - s_o) >= 0.0)
        back = float(t[np.argmax(met)]) if met.any() else max(turn, end) + 1.0
        return [(turn, float(side)), (back, place(back) if met.any() else side + sign * speed * (back - turn))]

    corners: tuple[list[tuple[float, float]], ...] = [(0.0, 0.0)], [(0.0, 0.0)]
    now, side = 0.0, 1  # of the front
    while now < end:
        way = trip(now, side)
        corners[side].extend(way)
        back, other = way[-1][0], 1 - side
        while now < end:  # what the car has thrown back, as long as it is home in time
            way = trip(now, other)
            if way[-1][0] - now < least or way[-1][0] > back:
                break
            corners[other].extend(way)
            now = way[-1][0]
        if corners[other][-1][0] < back:
            corners[other].append((back, place(back)))
        now, side = back, other
    left, right = (np.array(x) for x in corners)
    return left, right
