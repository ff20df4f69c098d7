"""Rows of a line, one for each unknown: the functions between contacts, and the balances at contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from cablefem.scene.contacts import Array, Car, Contact, MovingLine, Wheel
from galerkin.bodies import Body, ContactState, Counterweight, Friction, PointCar, Saddle, Spring
from galerkin.segments import Layout, Rope
from galerkin.trolley import Trolley


def body_at_contact(line: MovingLine, contact: Contact | Car | Wheel) -> Body:
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


class RopeDerivatives(NamedTuple):
    """Derivatives of what the rope does, by the coordinates of each segment."""

    rows: Array  # of `Rope.row_derivatives_until_next_call`
    end_slopes: Array  # of `Rope.end_slope_derivatives`


class LineEquations:
    """Rows of a line, one for each unknown."""

    def __init__(self, layout: Layout, bodies: Sequence[Body]) -> None:
        self.layout = layout
        self.bodies = bodies
        x, y, t, u, v = layout.moving.T
        next_s = np.roll(layout.s, -1)
        at = {"x": x, "y": y, "t": t, "u": u, "v": v, "s": layout.s, "S": next_s, "F": layout.F}
        of_bodies = [at[name][k] for k, body in enumerate(bodies) for name in body.unknown]
        # coordinates of the unknowns; the rows of the last ones are set by `CarOffRope`
        self.free = np.array([*layout.shapes, *of_bodies, *layout.angle_off_rope.values()])
        self.forces = np.isin(self.free, layout.F)
        self.size = self.free.size
        # columns of coordinates: unknowns; those that follow and the last, of known ones, are cut off
        dependent = [i for coordinates in layout.dependent for i in coordinates.p]
        last = self.size + len(dependent)
        self._column = np.full(layout.size, last)
        self._column[[*self.free, *dependent]] = np.arange(last)
        self._segment_columns = self._column[layout.columns]
        self._tangent = np.zeros((3, self.size, last + 1))

    def contact_values(self, rope: Rope, Z: Array) -> Array:
        """The values of `ContactState` at all contacts (..., contacts, 26)."""
        layout = self.layout
        x = np.zeros((*Z.shape[1:-1], layout.contacts, ContactState.size))
        rows = rope.balance_rows
        x[..., 1:, 0:2] = rows[..., -1, :]
        x[..., :-1, 2:4] = -rows[..., -2, :]
        x[..., 1:, 4:6] = rope.end_slopes[..., 1, :]
        x[..., :-1, 6:8] = rope.end_slopes[..., 0, :]
        for order in range(3):
            x[..., 8 + 5 * order : 13 + 5 * order] = Z[order][..., layout.moving]
        x[..., 23] = Z[1][..., layout.s]
        x[..., 24] = Z[2][..., layout.s]
        x[..., 25] = Z[2][..., layout.F]
        return x

    def contact_state(self, contact_values: Array, k: int) -> Any:
        """What acts on the body at contact k, as its equations take it."""
        body = self.bodies[k]
        return body.state_from_contact_values(contact_values[..., k : k + body.contacts, :])

    def residual(self, rope: Rope, contact_values: Array, frictions: Sequence[Friction]) -> Array:
        """The rows (..., n) of a rope with the values of its contacts."""
        instants = contact_values.shape[:-2]
        of_rope = rope.balance_rows[..., :-2, :].reshape(*instants, self.layout.inner)
        rows = [of_rope[..., self.layout.shapes]]
        for k, body in enumerate(self.bodies):
            if body.unknown:
                state = self.contact_state(contact_values, k)
                rows.append(body.balance_rows(state, frictions[k]))
        rows.append(np.zeros((*instants, len(self.layout.angle_off_rope))))
        return np.concatenate(rows, axis=-1)

    def residual_and_derivatives(self, Z: Array, frictions: Sequence[Friction]) -> tuple[Array, Array]:
        """The residual, and its derivatives (3, n, n) by unknowns, their velocities and accelerations.

        The next call overwrites the derivatives.
        """
        rope = Rope(self.layout, Z)
        layout = self.layout
        of_rope = RopeDerivatives(rope.row_derivatives_until_next_call(), rope.end_slope_derivatives)
        K = self._tangent
        K[:] = 0.0
        row = 0
        for i, shapes in enumerate(layout.functions_of):
            block = of_rope.rows[:, i, :-2].reshape(3, 2 * layout.functions, -1)[:, shapes]
            after = row + block.shape[1]
            K[:, row:after, self._segment_columns[i]] = block
            row = after
        contact_values = self.contact_values(rope, Z)
        for k, body in enumerate(self.bodies):
            if not body.unknown:
                continue
            rows = slice(row, row + len(body.unknown))
            derivatives = body.balance_row_derivatives(contact_values[k : k + body.contacts], frictions[k])
            for j, by_values in enumerate(derivatives.swapaxes(0, 1), start=k):
                self._add_derivatives_through_contact(j, by_values, of_rope, K[:, rows])
            row = rows.stop
        for dependent in reversed(layout.dependent):
            dependent.fold_dependent_derivatives(K, Z, self._column)
        return self.residual(rope, contact_values, frictions), K[:, :, : self.size]

    def _add_derivatives_through_contact(self, j: int, by_values: Array, of_rope: RopeDerivatives, K: Array) -> None:
        """Add derivatives of a body's rows, by the values of contact j (rows, 26), to K (3, rows, columns)."""
        layout = self.layout
        if j > 0:
            behind = self._segment_columns[j - 1]
            K[:, :, behind] += by_values[:, 0:2] @ of_rope.rows[:, j - 1, -1]
            K[0][:, behind] += by_values[:, 4:6] @ of_rope.end_slopes[j - 1, 1]
        if j < layout.segments:
            ahead = self._segment_columns[j]
            K[:, :, ahead] -= by_values[:, 2:4] @ of_rope.rows[:, j, -2]
            K[0][:, ahead] += by_values[:, 6:8] @ of_rope.end_slopes[j, 0]
        moving = self._column[layout.moving[j]]
        for order in range(3):
            K[order][:, moving] += by_values[:, 8 + 5 * order : 13 + 5 * order]
        K[1:, :, self._column[layout.s[j]]] += by_values[:, 23:25].T
        K[2, :, self._column[layout.F[j]]] += by_values[:, 25]
