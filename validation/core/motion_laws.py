"""Laws of a line in motion, and a second reading of its files, from the scene's TOML and the motion alone.

Over a window W(t) that vanishes with its slope at both ends, for the rope and all cars together:

    int W'' rho (int r ds) + W' rho [p ds]_ends - W' sum m v dt = int W (weights + haul + drag + thrust - pressures) dt
    int W (N - G) + W' (G/g) rise' dt = 0        of a counterweight

Energy less work, from the start: drives, drag, friction, and at a pulley the rope that enters with its weight q y:

    dE/dt = -e ds (N + N^2/(2 EA) + q y - rho (ds lam)^2/2),    e = 1 at the right end, -1 at the left one.

Left out: the momentum of the rope that enters, rho ds^2, below 1e-5 of the tension for 0.5 m/s.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from validation.core.motion_bodies import CarBody, to_complex
from validation.core.scene_data import ROUNDING, Array, LineData, read_csv_columns, rope_stresses_at_wheel

WINDOWS = 12


class LineTables(LineData):
    """A line in motion; lengths along a hot rope are heated ones."""

    def __init__(self, toml: str) -> None:
        super().__init__(toml)
        self.rho = self.mass / self.heat
        self.q = self.rho * self.gravity
        self.cars: dict[str, dict[str, Any]] = {car["name"]: car for car in self.data.get("car", [])}

    def counterweights(self) -> Iterator[tuple[float, int, dict[str, Any]]]:
        """e, index and table of a counterweight."""
        for e, k in ((-1.0, 0), (1.0, -1)):
            if self.contacts[k]["kind"] == "counterweight":
                yield e, k, self.contacts[k]


def tension_at_contact(contact: Any) -> Array:
    """Tension (n,) [N]; at a saddle that behind."""
    behind = contact.tension_behind
    return np.asarray(np.where(np.isnan(behind), contact.tension_ahead, behind))


def contacts_cars_and_rear_wheels(motion: Any) -> list[Any]:
    """All that touches the rope; a car of two wheels stands for its front one."""
    rear = [car.turning.wheels[0] for car in motion.cars if car.turning is not None and car.turning.wheels]
    return [*motion.contacts, *motion.cars, *rear]


class SampledMotion:
    """A motion at every step, or every second one, and the rope as a chain of points (n, k, 2)."""

    def __init__(self, line: LineTables, motion: Any, every: int) -> None:
        self.line = line
        self.taken = every_nth_step(motion.t, every)
        self.t = motion.t[self.taken]
        self.cars = list(motion.cars)
        self.contacts = list(motion.contacts)
        self.bodies = [CarBody(line.cars[car.name], car, motion, self.at_samples, line.gravity) for car in self.cars]
        touching = contacts_cars_and_rear_wheels(motion)
        first = self.contacts[0]
        tension = self.at_samples(motion.tension)
        here = np.isfinite(tension)  # stations on the rope; the others are put at the first contact
        s = np.where(here, motion.s, self._column(first.s))
        points = np.where(here[..., None], self.at_samples(motion.points), self._column(first.point))
        tension = np.where(here, tension, self._column(first.tension_ahead))
        s = np.concatenate([s, *(self._column(x.s) for x in touching)], axis=1)
        points = np.concatenate([points, *(self._column(x.point) for x in touching)], axis=1)
        tension = np.concatenate([tension, *(self.mean_tension_at(x)[:, None] for x in touching)], axis=1)
        order = np.argsort(s, axis=1, kind="stable")
        self.ds = np.diff(np.take_along_axis(s, order, axis=1), axis=1)  # (n, k - 1)
        chain = np.take_along_axis(points, order[..., None], axis=1)
        T = np.take_along_axis(tension, order, axis=1)
        self.middles = 0.5 * (chain[:, 1:] + chain[:, :-1])
        self.squares = 0.5 * (T[:, 1:] ** 2 + T[:, :-1] ** 2)
        self.kinetic = self._kinetic_energy_of_rope(motion)

    def at_samples(self, values: Array) -> Array:
        return np.asarray(values[self.taken])

    def _column(self, values: Array) -> Array:
        """Values (n, ...) at samples as one station (n, 1, ...)."""
        return self.at_samples(values)[:, None]

    def mean_tension_at(self, contact: Any) -> Array:
        """Mean (n,) [N] of the tensions behind and ahead, or the only one."""
        sides = np.array([self.at_samples(contact.tension_behind), self.at_samples(contact.tension_ahead)])
        return np.asarray(np.where(np.isnan(sides), sides[::-1], sides).mean(axis=0))

    def _kinetic_energy_of_rope(self, motion: Any) -> Array:
        """By the velocities of its stations (n,) [J]."""
        once = np.concatenate([[True], np.diff(self.t) > 0.0])
        points = self.at_samples(motion.points)
        velocity = np.gradient(points[once], self.t[once], axis=0)
        v2 = np.nan_to_num((velocity**2).sum(axis=2))  # (., m)
        length = np.gradient(motion.s)
        rows = np.cumsum(once) - 1
        return np.asarray(0.5 * self.line.rho * (v2 @ length)[rows])


def every_nth_step(t: Array, n: int) -> NDArray[np.intp]:
    """Indices of every n-th of the times t, and of both sides of each jump, where a time stands twice."""
    jumps = np.flatnonzero(np.diff(t) <= 0.0)
    firsts = [0, *(jumps + 1)]
    lasts = [*jumps, t.size - 1]
    pieces = [np.append(np.arange(first, last, n), last) for first, last in zip(firsts, lasts, strict=True)]
    return np.concatenate([np.unique(piece) for piece in pieces])


def _time_integral(t: Array, values: Array) -> Array:
    """Integral of values (n, ...) over t."""
    steps = np.diff(t).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((0.5 * (values[1:] + values[:-1]) * steps).sum(axis=0))


class WindowWeight(NamedTuple):
    """Weight function W(t) = (1 - cos x)^2/4 of a window of time, and its derivatives, at samples `part` (k,)."""

    part: slice
    W: Array
    W1: Array
    W2: Array


def _window_weights(t: Array, end: float) -> Iterator[WindowWeight]:
    """Those of WINDOWS windows, spread over the times t up to `end`."""
    share = 0.25  # length of a window over the run's
    length = share * end
    for middle in np.linspace(0.5 * length, end - 0.5 * length, WINDOWS):
        begin = middle - 0.5 * length
        low = max(int(np.searchsorted(t, begin)) - 1, 0)
        part = slice(low, int(np.searchsorted(t, begin + length, side="right")) + 1)
        k = 2.0 * math.pi / length
        x = np.clip(k * (t[part] - begin), 0.0, 2.0 * math.pi)
        cos = np.cos(x)
        sin = np.sin(x)
        W = 0.25 * (1.0 - cos) ** 2
        W1 = 0.5 * k * (1.0 - cos) * sin
        W2 = 0.5 * k**2 * (sin**2 + (1.0 - cos) * cos)
        yield WindowWeight(part, W, W1, W2)


def momentum_defects_by_window(toml: str, motion: Any, end: float, every: int = 1) -> Array:
    """Defects (WINDOWS, 2) of the momentum of rope and cars in x and y, over the largest tension."""
    line = LineTables(toml)
    x = SampledMotion(line, motion, every)
    moment = line.rho * (x.middles * x.ds[..., None]).sum(axis=1)  # (n, 2)
    force = np.zeros_like(moment)
    force[:, 1] = line.q * x.ds.sum(axis=1)
    impulse = np.zeros_like(moment)
    for body in x.bodies:
        outside = body.force + body.drag + 1j * body.data["mass"] * line.gravity
        force += np.stack([outside.real, outside.imag], axis=1)
        impulse += np.stack([body.momentum.real, body.momentum.imag], axis=1)
    for contact in x.contacts:
        force -= x.at_samples(contact.pressure)
    first = x.contacts[0]
    last = x.contacts[-1]
    at_last = x.at_samples(last.point) * x.at_samples(last.ds)[:, None]  # (n, 2)
    at_first = x.at_samples(first.point) * x.at_samples(first.ds)[:, None]
    entering = line.rho * (at_last - at_first)
    largest = max(float(np.max(x.mean_tension_at(body))) for body in (*x.contacts, *x.cars))
    out = []
    for part, W, W1, W2 in _window_weights(x.t, end):
        t = x.t[part]
        m = moment[part]
        share = ((t - t[0]) / (t[-1] - t[0]))[:, None]
        m = m - (m[0] + share * (m[-1] - m[0]))  # W'' and a linear function have no integral
        rate = W2[:, None] * m + W1[:, None] * (entering[part] - impulse[part])
        defect = _time_integral(t, rate - W[:, None] * force[part])
        out.append(defect / (_time_integral(t, W) * largest))
    return np.array(out)


def counterweight_defects_by_window(toml: str, motion: Any, end: float, every: int = 1) -> Array:
    """Defects of the motion of a counterweight, over its force."""
    line = LineTables(toml)
    steps = every_nth_step(motion.t, every)
    t = motion.t[steps]
    out = []
    for e, k, data in line.counterweights():
        G = data["tension"]
        contact = motion.contacts[k]
        N = tension_at_contact(contact)[steps]
        rate = e * (1.0 + G / line.EA) * contact.ds[steps]
        for part, W, W1, _ in _window_weights(t, end):
            weighted = W * (N[part] - G) + W1 * G / line.gravity * rate[part]
            defect = _time_integral(t[part], weighted)
            out.append(float(defect) / (G * float(_time_integral(t[part], W))))
    return np.array(out)


def energy_defects(toml: str, motion: Any, end: float, every: int = 1) -> Array:
    """Energy less work since the start (n,), over all work done."""
    line = LineTables(toml)
    x = SampledMotion(line, motion, every)
    depth = (x.middles[..., 1] * x.ds).sum(axis=1)  # integrals over the rope (n,)
    squared_tension = (x.squares * x.ds).sum(axis=1)
    E = x.kinetic - line.q * depth + squared_tension / (2.0 * line.EA)
    powers = []
    for body in x.bodies:
        E += body.energy
        powers += body.powers
    for contact, table in zip(x.contacts, line.contacts, strict=True):
        if table["kind"] == "spring":
            shift = x.at_samples(contact.point) - table["at"]  # (n, 2)
            E += 0.5 * (np.array(table["stiffness"]) * shift**2).sum(axis=1)
    for e, k, table in line.counterweights():
        contact = x.contacts[k]
        N = x.mean_tension_at(contact)
        ds = x.at_samples(contact.ds)
        moving = 0.5 * line.rho * (ds * (1.0 + N / line.EA)) ** 2
        per_length = N + N**2 / (2.0 * line.EA) + line.q * table["at"][1] - moving
        powers.append(-e * ds * per_length)
    steps = np.diff(x.t)

    def work_since_start(power: Array) -> Array:
        means = 0.5 * (power[1:] + power[:-1])
        return np.append(0.0, np.cumsum(means * steps))

    scale = sum(float(work_since_start(np.abs(power))[-1]) for power in powers) or 1.0
    return np.asarray((E - E[0] - work_since_start(np.sum(powers, axis=0))) / scale)


def moment_defects_by_window(toml: str, motion: Any, end: float, every: int = 1) -> Array:
    """Defects of the moment of momentum of cabins and cars on two wheels, over their weight and size."""
    x = SampledMotion(LineTables(toml), motion, every)
    out = []
    for body in x.bodies:
        if body.turning is None:
            continue
        moment, momentum = body.moment_and_angular_momentum()
        for part, W, W1, _ in _window_weights(x.t, end):
            t = x.t[part]
            defect = float(_time_integral(t, W * moment[part] + W1 * momentum[part]))
            scale = body.masses[1][0] * body.g * body.size
            out.append(defect / (scale * float(_time_integral(t, W))))
    return np.array(out)


def kink_force_defects_by_window(toml: str, motion: Any, end: float, every: int = 1) -> Array:
    """Defects of the forces of cabins and wheels on the rope, by its tensions and slopes there, over the weight."""
    line = LineTables(toml)
    x = SampledMotion(line, motion, every)
    out = []
    for body in x.bodies:
        for touching in body.touching if body.turning is not None else ():
            defect = touching.force_on_rope - touching.force_from_rope_kink(line.rho)
            weight = body.data["mass"] * body.g
            for part, W, _, _ in _window_weights(x.t, end):
                t = x.t[part]
                along = _time_integral(t, W * defect.real[part])
                down = _time_integral(t, W * defect.imag[part])
                out.append(math.hypot(along, down) / (weight * float(_time_integral(t, W))))
    return np.array(out)


def centre_of_mass_defects(toml: str, motion: Any, end: float, every: int = 1) -> Array:
    """Distances beyond rounding of centres of mass from where contacts and angles put them, over the body's size."""
    x = SampledMotion(LineTables(toml), motion, every)
    distances = []
    for body in x.bodies:
        if body.turning is not None:
            centre = to_complex(x.at_samples(body.turning.centre))
            distances.append(np.max(np.abs(centre - body.c)) / body.size)
    return np.asarray(np.maximum(np.array(distances) - ROUNDING, 0.0))


def holding_force_excesses_by_window(toml: str, motion: Any, end: float, every: int = 1) -> Array:
    """Means of the forces that hold standing cars, by the rope's tensions, beyond friction and brakes, over the weight.

    Waves in the rope pass the limit for moments; the mean of a car that stays does not.
    """
    x = SampledMotion(LineTables(toml), motion, every)
    out = []
    for body in x.bodies:
        held = body.held_by_friction * body.touching[-1].along
        largest = body.held_by_friction * body.resistance
        for part, W, _, _ in _window_weights(x.t, end):
            t = x.t[part]
            needed = abs(float(_time_integral(t, W * held[part])))
            excess = needed - float(_time_integral(t, W * largest[part]))
            weight = body.data["mass"] * body.g
            out.append(max(excess, 0.0) / (weight * float(_time_integral(t, W))))
    return np.array(out)


def any_free_car_sticks(toml: str, motion: Any) -> bool:
    """Whether friction holds a free car for a while."""
    cars = LineTables(toml).cars
    for car in motion.cars:
        free = cars[car.name].get("drive", {}).get("mode") == "free"
        stands = car.ds == 0.0
        if free and np.any(stands[:-1] & stands[1:]):
            return True
    return False


LAWS = {
    "momentum of rope and cars": momentum_defects_by_window,
    "energy and work": energy_defects,
}
FRICTION_LAWS = {"friction that holds cars": holding_force_excesses_by_window}
COUNTERWEIGHT_LAWS = {"motion of the counterweight": counterweight_defects_by_window}
BODY_LAWS = {
    "moment of momentum of bodies": moment_defects_by_window,
    "forces on kinks of the rope": kink_force_defects_by_window,
    "centres of mass": centre_of_mass_defects,
}


def faults_of_line_files(folder: Path, motion: Any, design: Sequence[dict[str, Any]], period: float) -> list[str]:
    """Faults of path-NAME.csv, contacts.csv and the design numbers, each a sentence; none where all is as computed.

    period : [s] over which printed forces are means.
    """
    files = _LineFiles(folder, motion, period)
    faults: list[str] = []
    balance = 1e-3  # of a load by hand: elements balance a car along the rope in the mean over its segments
    for car in motion.cars:
        name = f"path-{car.name}.csv"
        path = files.paths[car.name]
        faults += _column_faults(name, path, _expected_columns_of_car(car, motion))
        faults += _column_faults(name, path, _wheel_loads_by_hand(files.line, car, motion), balance)
    for contact in motion.contacts:
        faults += _column_faults("contacts.csv", files.contacts, _expected_columns_of_contact(contact))
    for number in design:
        faults += files.faults_of_design_number(number)
    return faults


def _expected_columns_of_car(car: Any, motion: Any) -> dict[str, Array]:
    """Columns (n,) of a car's file."""
    path = {
        "t": motion.t, "s_o": car.s, "x": car.point[:, 0], "y": car.point[:, 1], "T_behind": car.tension_behind,
        "T_ahead": car.tension_ahead, "speed": np.hypot(*car.velocity.T), "F_contact": car.contact_force,
        "F_haul": car.haul_force,
    }  # fmt: skip
    if car.shoe_force.any():
        path["F_shoe"] = car.shoe_force
    if car.turning is not None:
        path["pitch" if car.turning.wheels else "swing"] = np.degrees(car.turning.angle)
        path |= {f"wheel_{x.name.rpartition('.')[2]}": x.load for x in car.turning.wheels}
    return path


def _expected_columns_of_contact(contact: Any) -> dict[str, Array]:
    """Columns (n,) of contacts.csv."""
    columns = {
        "s": contact.s, "tension": tension_at_contact(contact), "pressure": np.hypot(*contact.pressure.T),
        "rise": contact.rise,
    }  # fmt: skip
    return {f"{contact.name}.{name}": values for name, values in columns.items()}


class _LineFiles:
    """What the files of a line in motion say."""

    def __init__(self, folder: Path, motion: Any, period: float) -> None:
        self.line = LineTables((folder / "scene.toml").read_text(encoding="utf-8"))
        self.motion = motion
        self.period = period
        self.paths = {car.name: read_csv_columns(folder / f"path-{car.name}.csv") for car in motion.cars}
        self.contacts = read_csv_columns(folder / "contacts.csv")
        self.t = self.contacts["t"]

    def faults_of_design_number(self, number: dict[str, Any]) -> Iterator[str]:
        """Faults of a design number: it is not the extreme, or not the value at its time, or its car is elsewhere."""
        name = number["quantity"]
        values = self._extreme_and_value_at_time(number)
        allowed = (number["bar"] or 0.0) + 1e-9 * abs(number["value"])
        if not all(abs(value - number["value"]) <= allowed for value in values):
            stored = ", at its time ".join(f"{value:.6g}" for value in values)
            yield f"{name} = {number['value']:.6g}: the files give {stored}"
        path = self.paths.get(name.partition(":")[2].partition(".")[0])
        if path is None:
            return
        distance = abs(np.interp(number["t"], self.t, path["s_o"]) - number["s_o"])
        if distance > 1e-9 * number["s_o"]:
            yield f"{name}: the car is not at {number['s_o']:.6g} m then"

    def _extreme_and_value_at_time(self, number: dict[str, Any]) -> list[float]:
        """Of the files: the extreme of a design number, and of a series its value at the number's time."""
        kind, _, of = number["quantity"].partition(":")
        name, _, word = kind.rpartition("_")
        if name == "clearance":
            return [float(min(np.min(values) for values in self._clearances_of_body_over_obstacle(kind, of)))]
        if name == "safety_factor":
            tensions = _averaged_if_force("tension", self._columns_by_quantity["tension"], self.t, self.period)
            values = self.line.data["cable"]["breaking_load"] / tensions
        else:
            columns = self._columns_by_quantity[f"{name}:{of}" if of else name]
            values = _averaged_if_force(name, columns, self.t, self.period)
        if name in ("grip", "contact") and "drive" not in self.line.cars[of]:
            values = _averaged_if_force(name, values, self.t, self.period)  # a car that grips rings: means of means
        now = self.t == self.t[np.argmin(np.abs(self.t - number["t"]))]
        pick = np.max if word == "max" else np.min
        return [float(pick(values)), float(pick(values[:, now]))]

    def _clearances_of_body_over_obstacle(self, kind: str, body_over_obstacle: str) -> list[Array]:
        """Columns (n,) of heights over an obstacle or the ground.

        Of a car; of kind clearance_rope: of the rope and of the points of all cars.
        """
        scene = self.line.data
        body, _, over = body_over_obstacle.rpartition(" over ")
        below = {car["name"]: car.get("below", 0.0) for car in scene["car"]}
        heights = []
        if kind == "clearance_rope":
            below = dict.fromkeys(below, 0.0)
            heights = [_min_heights_of_rope(scene, self.motion, over)]
        profile = _ground_or_obstacle_profile(scene, over)
        for car in below:
            if body in ("", car):
                heights.append(_heights_of_car(profile, self.paths[car]) - below[car])
        return heights

    @cached_property
    def _columns_by_quantity(self) -> dict[str, list[Array]]:
        """Columns by quantity; of a load its two components."""
        contacts = self.motion.contacts
        out = {"tension": [self.contacts[f"{x.name}.tension"] for x in contacts]}
        for name, path in self.paths.items():
            out["tension"] += [path["T_behind"], path["T_ahead"]]
            out |= {f"{kind}:{name}": [path[column]] for kind, column in COLUMN_OF_QUANTITY.items() if column in path}
            out |= {f"wheel:{name}.{x}": [path[f"wheel_{x}"]] for x in ("rear", "front") if f"wheel_{x}" in path}
            out |= {f"{kind}:{name}": values for kind, values in self._rope_stresses_at_wheels(name, path).items()}
        out |= {f"grip:{car.name}": [car.grip_force] for car in self.motion.cars}
        for x in contacts:
            s = self.contacts[f"{x.name}.s"]
            out |= {f"rise:{x.name}": [self.contacts[f"{x.name}.rise"]], f"flow:{x.name}": [s - s[0]]}
            out[f"load:{x.name}"] = list(x.pressure.T)
        return out

    def _rope_stresses_at_wheels(self, car_name: str, path: dict[str, Array]) -> dict[str, list[Array]]:
        """Of the rope behind the rear and ahead of the front wheels of a car, by kind."""
        wheels = self.line.cars[car_name].get("wheels", {})
        out: dict[str, list[Array]] = {}
        if not wheels:
            return out
        for side, N in (("rear", path["T_behind"]), ("front", path["T_ahead"])):
            Q = path.get(f"wheel_{side}", 0.5 * path["F_contact"]) * 2.0 / wheels.get("count", 2)
            for kind, values in rope_stresses_at_wheel(self.line.data["cable"], wheels, N, Q).items():
                out.setdefault(kind, []).append(values)
        return out


# kinds of design numbers, and their columns of a car's file
COLUMN_OF_QUANTITY = {
    "haul": "F_haul", "contact": "F_contact", "speed": "speed", "depth": "y", "swing": "swing", "pitch": "pitch",
}  # fmt: skip


def _averaged_if_force(kind: str, values: Any, t: Array, period: float) -> Array:
    """Series (k, n) of a kind; those of forces averaged over a period, "load" as the length of its vector."""
    if kind.startswith(("tension", "haul", "grip", "contact", "load", "wheel", "stress")):
        values = [_moving_mean(t, v, period) for v in values]
    return np.array([np.hypot(*values)] if kind == "load" else values)


def _wheel_loads_by_hand(line: LineTables, car: Any, motion: Any) -> dict[str, Array]:
    """Loads (n,) of both wheels of a point car by the balance of moments about its centre of mass."""
    data = line.cars[car.name]
    wheels = data.get("wheels", {})
    if wheels.get("model") != "point" or "base" not in wheels:
        return {}
    body = CarBody(data, car, motion, np.asarray, line.gravity)
    rope = body.touching[0]
    turning = body.moment + wheels.get("below", 0.0) * rope.along * rope.projection
    front = rope.load * (0.5 + wheels.get("ahead", 0.0) / wheels["base"]) + turning / wheels["base"]
    return {"wheel_rear": rope.load - front, "wheel_front": front}


def _ground_or_obstacle_profile(scene: dict[str, Any], name: str) -> Array:
    """x and depth (2, n) [m] of an obstacle or the ground."""
    if name == "the ground":
        return np.array(scene["ground"], float).T
    return np.array([[o["at"], o["top"]] for o in scene["obstacle"] if o["name"] == name]).T


def _heights_of_car(ground: Array, table: dict[str, Array]) -> Array:
    """Heights of a car's wheels over rows x and depth of a ground, along its path and at each corner; inf beyond."""
    x, depth = ground
    path = np.stack([table["x"], table["y"]])  # (2, n)
    begin = path[:, :-1, None]
    step = np.diff(path)[:, :, None]
    upright = step[0] == 0.0
    w = np.where(upright, -1.0, (x - begin[0]) / np.where(upright, 1.0, step[0]))  # (n - 1, corners)
    at_corners = (depth - begin[1] - w * step[1])[(w >= 0.0) & (w <= 1.0)]
    inside = (path[0] >= x[0]) & (path[0] <= x[-1])
    along = np.interp(path[0], x, depth)[inside] - path[1, inside]
    return np.concatenate([at_corners, along, [np.inf]])


def _min_heights_of_rope(scene: dict[str, Any], motion: Any, over: str) -> Array:
    """Least height (n,) of the rope, straight between stations, cars and contacts."""
    x, depth = _ground_or_obstacle_profile(scene, over)
    lowest = np.empty(motion.t.size)
    for i in range(motion.t.size):
        known = np.isfinite(motion.tension[i])
        stations = np.column_stack([motion.s[known], motion.points[i, known]])  # rows s, x, y
        bodies = [np.array([[body.s[i], *body.point[i]]]) for body in contacts_cars_and_rear_wheels(motion)]
        chain = np.concatenate([stations, *bodies])
        _, at, y = chain[np.argsort(chain[:, 0], kind="stable")].T
        inside = (at >= x[0]) & (at <= x[-1])
        at_corners = depth - np.interp(x, at, y)
        at_vertices = np.interp(at[inside], x, depth) - y[inside]
        lowest[i] = np.concatenate([at_corners, at_vertices]).min()
    return lowest


def _column_faults(
    file: str, table: dict[str, Array], expected: dict[str, Array], rounding: float = ROUNDING
) -> Iterator[str]:
    """A sentence for each expected column (n,) that the table lacks or has with other values."""
    for name, values in expected.items():
        scale = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
        allowed = rounding * scale + 1e-12
        same_shape = name in table and table[name].shape == values.shape
        if not (same_shape and np.allclose(table[name], values, rtol=0.0, atol=allowed, equal_nan=True)):
            yield f"{file}: {name} is not what was computed"


def _moving_mean(t: Array, values: Array, period: float) -> Array:
    """Means over the `period` around each time, inside the run; the values follow splines between jumps."""
    begins = np.clip(t - 0.5 * period, t[0], max(t[-1] - period, t[0]))
    ends = np.minimum(begins + period, t[-1])
    total = np.zeros(t.size)
    for part in np.split(np.arange(t.size), np.flatnonzero(np.diff(t) <= 0.0) + 1):
        if part.size > 1:
            integral = CubicSpline(t[part], values[part]).antiderivative()
            span = t[part[0]], t[part[-1]]
            total += integral(np.clip(ends, *span)) - integral(np.clip(begins, *span))
    return total / (ends - begins)
