"""Rows of a line, one for each unknown: the functions between contacts, and the balances at contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

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
        return Counterweight(contact, 1.0 if contact is line.contacts[-1] else -1.0, line)
    if contact.kind == "spring":
        return Spring(contact)
    return Saddle() if contact.kind == "saddle" else Body()


class LineEquations:
    """Rows of a line, one for each unknown."""

    def __init__(self, layout: Layout, bodies: Sequence[Body]) -> None:
        self.layout = layout
        self.bodies = bodies
        x, y, t, u, v = layout.moving.T
        at = {"x": x, "y": y, "t": t, "u": u, "v": v, "s": layout.s, "S": np.roll(layout.s, -1), "F": layout.F}
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
        self._tangent = np.zeros((3, self.size, last + 1))

    def contact_values(self, rope: Rope, Z: Array) -> Array:
        """The values of `ContactState` at all contacts (..., contacts, 26)."""
        layout = self.layout
        x = np.zeros((*Z.shape[1:-1], layout.contacts, ContactState.size))
        x[..., 1:, 0:2] = rope.balance_rows[..., -1, :]
        x[..., :-1, 2:4] = -rope.balance_rows[..., -2, :]
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
        of_bodies = [
            body.balance_rows(self.contact_state(contact_values, k), frictions[k])
            for k, body in enumerate(self.bodies)
            if body.unknown
        ]
        every = rope.balance_rows[..., :-2, :].reshape(*contact_values.shape[:-2], self.layout.inner)
        inner = every[..., self.layout.shapes]
        off_rope = np.zeros((*inner.shape[:-1], len(self.layout.angle_off_rope)))
        return np.concatenate([inner, *of_bodies, off_rope], axis=-1)

    def linearise(self, Z: Array, frictions: Sequence[Friction]) -> tuple[Array, Array]:
        """The residual, and its derivatives (3, n, n) by unknowns, their velocities and accelerations.

        The next call overwrites the derivatives.
        """
        rope = Rope(self.layout, Z)
        layout = self.layout
        by_rows = rope.row_derivatives_until_next_call()
        by_slopes = rope.end_slope_derivatives
        K = self._tangent
        K[:] = 0.0
        r = np.zeros(self.size)
        r[: layout.shapes.size] = rope.balance_rows[:, :-2].ravel()[layout.shapes]
        columns = self._column[layout.columns]
        row = 0
        for i, shapes in enumerate(layout.functions_of):
            block = by_rows[:, i, :-2].reshape(3, 2 * layout.functions, -1)[:, shapes]
            K[:, row : row + block.shape[1], columns[i]] = block
            row += block.shape[1]
        contact_values = self.contact_values(rope, Z)
        for k, body in enumerate(self.bodies):
            if not body.unknown:
                continue
            rows = slice(row, row + len(body.unknown))
            r[rows] = body.balance_rows(self.contact_state(contact_values, k), frictions[k])
            derivatives = body.balance_row_derivatives(contact_values[k : k + body.contacts], frictions[k])
            for j in range(k, k + body.contacts):
                self._add_body_derivatives(K[:, rows], derivatives[:, j - k], j, by_rows, by_slopes)
            row = rows.stop
        for dependent in reversed(layout.dependent):
            dependent.fold_dependent_derivatives(K, Z, self._column)
        return r, K[:, :, : self.size]

    def _add_body_derivatives(self, K: Array, by_values: Array, contact: int, by_rows: Array, by_slopes: Array) -> None:
        """Add the derivatives of a body's rows through one contact to K (3, rows, columns).

        by_values : by the values of `ContactState` there (rows, 26);  by_rows, by_slopes : of these by coordinates
        """
        layout = self.layout
        j = contact
        columns = self._column[layout.columns]
        if j > 0:
            K[:, :, columns[j - 1]] += by_values[:, 0:2] @ by_rows[:, j - 1, -1]
            K[0][:, columns[j - 1]] += by_values[:, 4:6] @ by_slopes[j - 1, 1]
        if j < layout.segments:
            K[:, :, columns[j]] -= by_values[:, 2:4] @ by_rows[:, j, -2]
            K[0][:, columns[j]] += by_values[:, 6:8] @ by_slopes[j, 0]
        for order in range(3):
            K[order][:, self._column[layout.moving[j]]] += by_values[:, 8 + 5 * order : 13 + 5 * order]
        K[1:, :, self._column[layout.s[j]]] += by_values[:, 23:25].T
        K[2, :, self._column[layout.F[j]]] += by_values[:, 25]
