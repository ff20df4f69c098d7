"""Events of a line in motion: what is watched, and by which names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from cablefem.scene.contacts import AT_REST, Contact, MovingLine, lift_off_event_name, meeting_event_name
from cablefem.shoes import car_may_pass_saddle, possible_passages
from galerkin.bodies import Body, CarBody, Saddle


class WatchedEvents:
    """What each kind of event watches; `names` in the order of `LineSines.event_values`."""

    def __init__(self, line: MovingLine, bodies: Sequence[Body], cars: Mapping[int, CarBody]) -> None:
        """cars : by contact, those on two wheels by the rear one."""
        self.passages = possible_passages(line)
        self.gaps = self._segments_where_cars_may_meet(line, cars)
        # contacts of free cars that may stop, and the positions where their brakes begin
        self.stops: list[int] = []
        self.brakes: list[tuple[int, float]] = []
        for k, body in cars.items():
            drive = body.car.drive
            if body.car.drive_kind == "free" and drive.has_friction_or_brakes:
                self.stops.append(k)
                self.brakes += [(k, position) for position, _ in drive.brakes]
        self.saddles = [k for k, body in enumerate(bodies) if isinstance(body, Saddle)]
        self.names = self._event_names(line, {k: body.car.name for k, body in cars.items()})

    def _segments_where_cars_may_meet(self, line: MovingLine, cars: Mapping[int, CarBody]) -> list[int]:
        """Segments beside cars, but for those between two wheels and those to a saddle that a car may pass."""
        names = [contact.name for contact in line.contacts_and_wheels]
        fronts = [k + body.contacts - 1 for k, body in cars.items()]
        between_wheels = [k for k, body in cars.items() if body.contacts > 1]
        segments = []
        for i, (left, right) in enumerate(pairwise(names)):
            beside_car = i in fronts or i + 1 in cars
            if beside_car and i not in between_wheels and not car_may_pass_saddle(self.passages, left, right):
                segments.append(i)
        return segments

    def _event_names(self, line: MovingLine, cars: Mapping[int, str]) -> tuple[str, ...]:
        """cars : names by contact."""
        touching = line.contacts_and_wheels
        meetings = [meeting_event_name(touching[i], touching[i + 1]) for i in self.gaps]
        stops = [f"{cars[k]} stops" for k in self.stops]
        brakes = [f"{cars[k]} brakes" for k, _ in self.brakes]
        wheels = [lift_off_event_name(contact) for contact in touching if not isinstance(contact, Contact)]
        saddles = [f"rope lifts off {touching[k].name}" for k in self.saddles]
        starts = [f"{cars[k]} breaks loose" for k in self.stops]
        by_force = [*wheels, "rope falls slack", *saddles, *starts, AT_REST]
        return *meetings, *stops, *brakes, *by_force, *map(str, self.passages)
