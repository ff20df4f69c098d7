"""What a run returns, in SI: path, fields, forces, energies and work."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import InitVar, asdict, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from cablefem import views
from cablefem.motion import CarMotion, ContactMotion

Array = NDArray[np.float64]
_ABSENT: Any = None  # nan, or of a pointwise tension the other one


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """Dimensionless measurements, named as in `Response` and `Fields`; n times, k frames, m stations.

    path .. slope_ahead, reactions, contact: (n, 2); u, v, du, dv, T, T_pointwise: (k, m); others (n,).
    """

    t: Array
    s_o: Array
    path: Array  # displacement of the mass
    path_velocity: Array  # of the place of the mass
    path_acceleration: Array
    slope_behind: Array  # r'
    slope_ahead: Array
    T_behind: Array
    T_ahead: Array
    energy: Array
    power: Array  # of drive and kink
    tension_min: Array
    tension_min_at: Array
    u: Array
    v: Array
    du: Array  # at fixed s
    dv: Array
    T: Array
    reaction_left: Array = _ABSENT
    reaction_right: Array = _ABSENT
    contact: Array = _ABSENT
    haul: Array = _ABSENT  # `F_haul`
    T_behind_pointwise: Array = _ABSENT
    T_ahead_pointwise: Array = _ABSENT
    T_pointwise: Array = _ABSENT
    kinetic: Array = _ABSENT
    strain: Array = _ABSENT
    potential: Array = _ABSENT
    powers: dict[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        other = {"T_behind_pointwise": self.T_behind, "T_ahead_pointwise": self.T_ahead, "T_pointwise": self.T}
        for name in _OBSERVED:
            if getattr(self, name) is None:
                pairs = name in ("reaction_left", "reaction_right", "contact")
                nan = np.full(self.path.shape if pairs else self.t.shape, np.nan)
                object.__setattr__(self, name, other.get(name, nan))

    @classmethod
    def concatenated(cls, parts: Sequence[Observation]) -> Observation:
        """One observation of consecutive ones."""
        if len(parts) == 1:
            return parts[0]
        powers = {name: np.concatenate([p.powers[name] for p in parts]) for name in parts[0].powers}
        return cls(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in _OBSERVED}, powers=powers)


_OBSERVED = tuple(name for name in Observation.__dataclass_fields__ if name != "powers")


@dataclass(frozen=True, slots=True)
class Fields:
    """Fields of a run, SI: k frames, m stations; s, x, y, T_static: (m,); u .. T, T_pointwise: (k, m); others (k,)."""

    t: Array  # [s]
    s_o: Array  # [m]
    s: Array  # [m]
    u: Array  # [m]
    v: Array  # [m]
    du: Array  # [m/s]
    dv: Array  # [m/s]
    T: Array  # [N]; at s = s_o behind
    T_behind: Array  # [N]
    T_ahead: Array  # [N]
    mass_u: Array  # [m]
    mass_v: Array  # [m]
    x: Array  # [m] at rest
    y: Array  # [m]
    T_static: Array  # [N]
    T_pointwise: Array  # [N] by slopes
    T_behind_pointwise: Array  # [N]
    T_ahead_pointwise: Array  # [N]


@dataclass(frozen=True, slots=True)
class Flag:
    """A reason to distrust a run: kind, numbers, and a format string."""

    kind: str
    words: str
    numbers: dict[str, float | str]

    def __str__(self) -> str:
        return self.words.format(**self.numbers)


Value = TypeVar("Value")


class LazyValue(Generic[Value]):
    """A value that is computed at the first call; what computes it is dropped then."""

    def __init__(self, compute: Callable[[], Value]) -> None:
        self._compute: Callable[[], Value] | None = compute

    def __call__(self) -> Value:
        if self._compute is not None:
            self._value = self._compute()
            self._compute = None
        return self._value


def _lazy_field(compute_default: Callable[[Response], Any] | None = None) -> Any:
    """A field that is computed when it is first looked at, and kept.

    compute_default : computes it where neither the field nor a function for it was given.
    """
    lazy: cached_property[Any] = cached_property(lambda r: r._later.get(lazy.attrname, compute_default)(r))
    return lazy


def _no_value(r: Response) -> None:
    """Of a field that is optional."""


def _empty_list(r: Response) -> list[Any]:
    return []


@dataclass(frozen=True, kw_only=True, eq=False)
class MassPath:
    """How the mass moved, SI, arrays (n,); y and v down."""

    method: str
    settings: dict[str, Any]
    status: str = "complete"  # | "incomplete"
    drive: str = "grip"
    slack_onset: float | None  # s_o/l
    length: float  # l [m]
    t: Array
    s_o: Array
    x: Array
    y: Array
    u: Array  # from the static cable
    v: Array
    work: dict[str, int]

    @property
    def reached(self) -> float:
        """s_o/l of the last step."""
        return float(self.s_o[-1] / self.length)

    @property
    def slack_onset_position_or_inf(self) -> float:
        """s_o/l of the slack onset, or infinite."""
        return math.inf if self.slack_onset is None else self.slack_onset

    @property
    def slack_time_or_inf(self) -> float:
        """Time [s] of the slack onset, or infinite."""
        if self.slack_onset is None:
            return math.inf
        return float(self.t[np.argmin(np.abs(self.s_o - self.slack_onset * self.length))])

    @property
    def max_deflection(self) -> float:
        """Largest v [m]; of a given travel past midspan only while taut."""
        onset = math.inf if self.drive == "free" else self.slack_onset_position_or_inf
        considered = self.v[self.s_o <= max(onset, 0.5) * self.length]
        return float(considered.max(initial=self.v[0]))

    @property
    def path_scale(self: Any) -> float:
        """Scale of path errors [m]."""
        return 0.1 * self.length if self.drive == "free" else self.max_deflection

    @property
    def path_scale_name(self: Any) -> str:
        """What `path_scale` is, in words."""
        return "a tenth of the length" if self.drive == "free" else "the largest deflection"


@dataclass(frozen=True, kw_only=True, eq=False)
class Response(MassPath):
    """The answer of one run, in SI; arrays (n,), but velocity .. slope_ahead, reactions and contact (n, 2).

    The path is there at once. All from `velocity` on is computed when it is first looked at, and kept; until then
    the states of the run are kept. T is total tension, with two values at the mass. `fields` holds the cable, `design`
    the extremes; r.at(t=12.0, s=100.0) answers for any time and point.

    later : functions of the response, by name, that compute fields which are not given.
    """

    scene: str
    scene_toml: str
    model: str
    load: str
    law: str
    reason: str | None
    cause: str | None = None
    slack_at: float | None  # s/l of the onset
    switched: float | None  # s_o/l of the switch of law = auto
    horizontal_tension: float  # H [N]
    breaks: list[float] = field(default_factory=list)  # [s] jumps of acceleration; samples are from before
    n_dof: int
    seconds: float  # of the time loop
    velocity: Array = _lazy_field()  # [m/s]
    acceleration: Array = _lazy_field()  # [m/s^2]
    slope_behind: Array = _lazy_field()  # d(place)/ds
    slope_ahead: Array = _lazy_field()
    T_behind: Array = _lazy_field()  # [N] nan on the left support
    T_ahead: Array = _lazy_field()  # [N] nan on the right support
    T_behind_pointwise: Array = _lazy_field()  # by slopes; T_behind is from equilibrium
    T_ahead_pointwise: Array = _lazy_field()
    reaction_left: Array = _lazy_field()  # [N] force on the cable
    reaction_right: Array = _lazy_field()
    contact: Array = _lazy_field()  # [N] of the mass on the cable
    F_haul: Array = _lazy_field()  # [N] outside force along the mean tangent, or nan
    tension_min: Array = _lazy_field()  # [N] least total tension
    tension_min_at: Array = _lazy_field()  # its s
    energy: Array = _lazy_field()  # [J] cable and mass
    kinetic: Array = _lazy_field()  # [J]
    strain: Array = _lazy_field()  # [J]
    potential: Array = _lazy_field()  # [J]
    power: Array = _lazy_field()  # [W] of the drive
    powers: dict[str, Array] = _lazy_field(lambda r: {})  # [W]
    fields: Fields = _lazy_field()
    events: list[dict[str, Any]] = _lazy_field(_empty_list)  # event, t, s_o, speed
    energy_gain: float | None = _lazy_field(_no_value)  # over weight x largest deflection
    flags: list[Flag] = _lazy_field(_empty_list)
    path_error: float | None = _lazy_field(_no_value)  # largest, over path_scale
    tension_error: float | None = _lazy_field(_no_value)  # rms off the jump, over H
    error_parts: dict[str, float] | None = _lazy_field(_no_value)
    error_window: list[float] | None = _lazy_field(_no_value)  # s_o/l
    design: list[dict[str, Any]] = _lazy_field(_empty_list)  # quantity, value, bar, unit, t, s_o, s
    later: InitVar[Mapping[str, Callable[[Response], Any]] | None] = None
    _later: ClassVar[Mapping[str, Callable[[Response], Any]]] = {}

    def __post_init__(self, later: Mapping[str, Callable[[Response], Any]] | None) -> None:
        values = vars(self)
        for name in [name for name, value in values.items() if isinstance(value, cached_property)]:
            del values[name]
        values["_later"] = later or {}

    def with_lazy_fields(self, **functions: Callable[[Response], Any]) -> Response:
        """A copy with these fields computed anew when they are looked at."""
        values = {name: value for name, value in vars(self).items() if name not in functions}
        other = object.__new__(Response)
        vars(other).update(values, _later={**self._later, **functions})
        return other

    def __getstate__(self) -> dict[str, Any]:
        """All fields, computed now: other processes get no states."""
        return {name: getattr(self, name) for name in FIELDS}

    @property
    def speed(self) -> Array:
        """|dp/dt| of the mass (n,) [m/s]."""
        return np.hypot(self.velocity[:, 0], self.velocity[:, 1])

    @property
    def cars(self) -> tuple[CarMotion, ...]:
        """The car, as on a line of several contacts."""
        return (views.single_car_motion(self),)

    @property
    def contacts(self) -> tuple[ContactMotion, ...]:
        """Left and right support, as on a line of several contacts."""
        return views.support_motions(self)

    @property
    def force_jump_times(self) -> list[float]:
        """Times [s] at which forces may jump."""
        return [*self.breaks, *(event["t"] for event in self.events)]

    @property
    def F_contact(self) -> Array:
        """Force (n,) [N] of the mass on the cable, normal to the mean tangent."""
        tangent = self.slope_behind + self.slope_ahead
        across = self.contact[:, 1] * tangent[:, 0] - self.contact[:, 0] * tangent[:, 1]
        return across / np.hypot(tangent[:, 0], tangent[:, 1])

    @property
    def flag_kinds(self) -> list[str]:
        return [flag.kind for flag in self.flags]

    def __repr__(self) -> str:
        return (
            f"Response({self.scene}: {self.method} {self.settings}, {self.status}, s_o/l to {self.reached:.3f}, "
            f"largest deflection {self.max_deflection:.5g} m)"
        )

    def at(self, *, t: Any, s: Any) -> dict[str, Array]:
        """Return x, y, u, v [m] and T [N], each (n, m), at t (n,) [s] and s (m,) [m].

        At the mass T is that behind. ValueError outside the run or the cable.
        """
        return views.sample_fields(self, t, s)

    def plot(self, ax: Any = None) -> Any:
        """Draw rope, envelope and path of the car; return matplotlib's axes."""
        return views.plot_side_view(self, ax)

    def plot_tension(self, ax: Any = None) -> Any:
        """Draw the tension; return matplotlib's axes."""
        return views.plot_tension(self, ax)

    def to_dataframe(self) -> Any:
        """Return path.csv as a pandas.DataFrame; units in `attrs["units"]`."""
        try:
            import pandas
        except ImportError:
            raise ImportError("to_dataframe() needs pandas: pip install 'cablefem[sweep]'") from None
        frame = pandas.DataFrame({name: getattr(self, name) for name in PATH_COLUMNS})
        frame.attrs["units"] = {"t": "s", **{name: _PATH_UNITS[name] for name in PATH_COLUMNS[1:]}}
        return frame

    def to_xarray(self) -> Any:
        """Return an xarray.Dataset: path over `t`, fields over (`frame`, `s`)."""
        try:
            import xarray
        except ImportError:
            raise ImportError("to_xarray() needs xarray: pip install 'cablefem[xarray]'") from None
        f = self.fields
        path: dict[str, Any] = {n: ("t", getattr(self, n), {"units": unit}) for n, unit in _PATH_UNITS.items()}
        for name, unit in _FIELD_UNITS.items():
            path[f"field_{name}"] = ("frame", "s"), getattr(f, name), {"units": unit}
        along = (("t", self.t, "s"), ("s", f.s, "m"), ("frame", f.t, "s"))
        coords = {name: (name, values, {"units": unit}) for name, values, unit in along}
        return xarray.Dataset(path, coords, {k: str(v) for k, v in self.summary().items()})

    def _repr_html_(self) -> str:
        return views.side_view_svg(self)

    def summary(self) -> dict[str, Any]:
        """Return the content of summary.json."""
        content = {name: getattr(self, name) for name in _SUMMARY} | {"flags": [str(flag) for flag in self.flags]}
        return content | self.work | {"seconds": self.seconds}

    def write(self, folder: Path | str) -> None:
        """Write path.csv, tension.csv, summary.json and response.npz."""
        folder = Path(folder)
        self.write_path_and_tension_csv(folder)
        self.write_npz_and_summary(folder)

    def write_path_and_tension_csv(self, folder: Path) -> None:
        """Write path.csv, and tension.csv: rows of time, station and tension [N], those beside the car last."""
        self.write_path_csv(folder)
        f = self.fields
        k, m = f.T.shape
        station = np.concatenate([np.broadcast_to(f.s, (k, m)), f.s_o[:, None], f.s_o[:, None]], axis=1)
        tension = np.concatenate([f.T, f.T_behind[:, None], f.T_ahead[:, None]], axis=1)
        columns = {"t": np.repeat(f.t, m + 2), "s": station.ravel(), "T": tension.ravel()}
        write_csv(folder / "tension.csv", columns)

    def write_path_csv(self, folder: Path) -> None:
        write_csv(folder / "path.csv", {name: getattr(self, name) for name in PATH_COLUMNS})

    def write_npz_and_summary(self, folder: Path) -> None:
        """Write response.npz, with all arrays, and summary.json."""
        f = self.fields
        arrays = {n: getattr(self, n) for n in _ARRAYS} | {f"fields.{n}": getattr(f, n) for n in _FIELDS}
        arrays |= {f"powers.{n}": power for n, power in self.powers.items()}
        plain = [n for n in FIELDS if n not in (*_ARRAYS, "fields", "powers")]
        rest = {n: getattr(self, n) for n in plain}
        rest["flags"] = [asdict(flag) for flag in self.flags]
        with atomic_write(folder / "response.npz") as temporary, temporary.open("wb") as out:
            np.savez(out, allow_pickle=False, _rest=np.array(json.dumps(rest)), **arrays)
        write_json(folder / "summary.json", self.summary())

    @classmethod
    def read(cls, folder: Path | str) -> Response:
        """Read back what `write` wrote."""
        with np.load(Path(folder) / "response.npz", allow_pickle=False) as data:
            fields = Fields(**{n: data[f"fields.{n}"] for n in _FIELDS})
            powers = {n.removeprefix("powers."): data[n] for n in data.files if n.startswith("powers.")}
            rest = json.loads(str(data["_rest"]))
            rest["flags"] = [Flag(**flag) for flag in rest["flags"]]
            return cls(**rest, **{n: data[n] for n in _ARRAYS}, fields=fields, powers=powers)


_SUMMARY = (
    "scene", "method", "settings", "model", "load", "law", "drive", "status", "reason", "cause", "reached",
    "slack_onset", "slack_at", "switched", "max_deflection", "path_scale", "path_error", "tension_error",
    "error_parts", "error_window", "events", "design", "energy_gain", "flags", "flag_kinds", "n_dof",
)  # fmt: skip
PATH_COLUMNS = ("t", "s_o", "x", "y", "u", "v", "T_behind", "T_ahead", "speed", "F_haul", "F_contact")  # of path.csv
_PATH_UNITS = {
    "s_o": "m", "x": "m", "y": "m", "u": "m", "v": "m", "T_behind": "N", "T_ahead": "N", "energy": "J", "power": "W",
    "tension_min": "N", "speed": "m/s", "F_haul": "N", "F_contact": "N",
}  # fmt: skip
_FIELD_UNITS = {"u": "m", "v": "m", "du": "m/s", "dv": "m/s", "T": "N"}
_FIELDS = tuple(Fields.__dataclass_fields__)
FIELDS = {field.name: field for field in fields(Response)}
_ARRAYS = tuple(name for name, field in FIELDS.items() if field.type == "Array")


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A temporary neighbour, put in place on success; an OSError names the file, also that of a full disk."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        error.filename = str(path)
        raise
    finally:
        temporary.unlink(missing_ok=True)


def write_csv(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns (n,) in full; NaN as an empty cell."""
    header = ",".join(columns)
    rows = np.stack(list(columns.values()), axis=1)
    with atomic_write(path) as temporary, temporary.open("w", encoding="ascii") as out:
        body = repr(rows.tolist())[2:-2].replace("], [", "\n").replace(", ", ",").replace("nan", "")
        out.write(f"{header}\n{body}\n" if rows.size else f"{header}\n")


def write_text(path: Path, text: str) -> None:
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write JSON; refuses NaN and infinity."""
    write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")
