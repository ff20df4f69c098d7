"""Rows of a line, one for each unknown: the functions between contacts, and the balances at contacts."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from cablefem.newmark import TangentFactors
from cablefem.scene.contacts import Array, Car, Contact, MovingLine, Wheel
from galerkin import kernels
from galerkin.bodies import Body, ContactState, Counterweight, PointCar, Saddle, Spring
from galerkin.segments import Layout
from galerkin.trolley import Trolley


def make_body_at_contact(line: MovingLine, contact: Contact | Car | Wheel) -> Body:
    """What a contact is tied to; a car on two wheels stands at the rear one."""
    if isinstance(contact, Wheel):
        return Body() if contact.front else Trolley(contact.car, line)
    if isinstance(contact, Car):
        return PointCar(contact, line)
    if contact.kind == "counterweight":
        outward = 1.0 if contact is line.contacts[-1] else -1.0
        return Counterweight(contact, outward, line)
    if contact.kind == "spring":
        return Spring(contact)
    return Saddle() if contact.kind == "saddle" else Body()


class BlockInverse(NamedTuple):
    """The inverse of a tangent, in which segments act on one another through contacts alone."""

    edges: Any  # rows of the functions of each segment, (segments + 1,)
    blocks: Any  # of the inverse of what is between contacts, (n, n)
    from_contacts: Any  # (n, m): the functions between contacts follow from the unknowns of contacts
    contacts: Any  # rows of the inverse, (m, n + m)

    def __call__(self, r: Any) -> Any:
        """The solution for r (n + m,)."""
        at_contacts = self.contacts @ r
        between = self.blocks @ r[: len(self.blocks)] - self.from_contacts @ at_contacts
        return np.concatenate([between, at_contacts])


class LineEquations:
    """Rows of a line, one for each unknown."""

    def __init__(self, layout: Layout, bodies: Sequence[Body]) -> None:
        self.layout = layout
        self.bodies = bodies
        x, y, t, u, v = layout.moving.T
        next_s = np.roll(layout.s, -1)
        at = {"x": x, "y": y, "t": t, "u": u, "v": v, "s": layout.s, "S": next_s, "F": layout.F}
        of_bodies = [at[name][k] for k, body in enumerate(bodies) for name in body.unknown]
        # coordinates of the unknowns; the rows of the last ones are set by `CarOnShoeOffRope`
        self.free = np.array([*layout.shapes, *of_bodies, *layout.angle_off_rope.values()])
        self.forces = np.isin(self.free, layout.F)
        self.size = self.free.size
        # columns of coordinates: unknowns; those that follow and the last, of known ones, are cut off
        dependent = [*layout.coordinates.followers["p"], *layout.coordinates.on_rails["y"]]
        last = self.size + len(dependent)
        column = np.full(layout.size, last)
        column[[*self.free, *dependent]] = np.arange(last)
        sizes = [part.stop - part.start for part in layout.functions_of]
        self.block_edges = np.cumsum([0, *sizes])
        rope = layout.line.rope
        self.line = kernels.Line(
            tables=layout.tables, at=layout.coordinates, free=self.free, shapes=layout.shapes, column=column,
            bodies=np.concatenate([body.kernel_record for body in bodies]), rho=rope.mass_per_length,
            gravity=layout.line.gravity, EA=rope.EA, damping=rope.damping,
        )  # fmt: skip
        # the same memory at each call, for large new arrays are slow
        functions = layout.functions + 2
        self._blocks = np.empty((3, layout.segments, functions, 2, 2 * functions + 2))
        self._tangent = np.empty((3, self.size, last + 1))

    def contact_state(self, contact_values: Array, k: int) -> ContactState:
        """What acts on the body at contact k."""
        return ContactState(contact_values[..., k : k + self.bodies[k].contacts, :].real)

    def evaluate(self, Z: Array, frictions: Array) -> kernels.LineValues:
        """The line with all coordinates Z (3, n, layout.size); frictions (n, contacts, 5) of `Friction`."""
        return kernels.evaluate_line(self.line, Z, frictions)

    def evaluate_with_derivatives(self, Z: Array, frictions: Array) -> tuple[kernels.LineValues, Array]:
        """The same at one instant, and derivatives (3, n, n) of the residual by unknowns and their two rates.

        The next call overwrites the derivatives.
        """
        K = self._tangent
        values = kernels.evaluate_line_and_set_derivatives(self.line, Z, frictions, self._blocks, K)
        return values, K[:, :, : self.size]

    def inverse_or_nan(self, c: TangentFactors, K: Array) -> Any:
        """`BlockInverse` of the tangent c0 K[0] + c1 K[1] + c2 K[2] (n, n); NaN if it has none."""
        tangent: Any = c[0] * K[0] + c[1] * K[1] + c[2] * K[2]
        n = self.block_edges[-1]
        blocks = np.zeros((n, n), tangent.dtype)
        by_contacts = tangent[:n, n:]
        of_contacts = tangent[n:, :n]
        try:
            for first, end in pairwise(self.block_edges):
                blocks[first:end, first:end] = np.linalg.inv(tangent[first:end, first:end])
            from_contacts = blocks @ by_contacts
            at_contacts = np.linalg.inv(tangent[n:, n:] - of_contacts @ from_contacts)
        except np.linalg.LinAlgError:
            blocks[:] = np.nan
            from_contacts = blocks @ by_contacts
            at_contacts = np.nan * tangent[n:, n:]
        contacts = np.concatenate([-at_contacts @ of_contacts @ blocks, at_contacts], axis=1)
        return BlockInverse(self.block_edges, blocks, from_contacts, contacts)
