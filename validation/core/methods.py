"""The table of all methods with their settings."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import entry_points
from numbers import Real
from typing import Any, NamedTuple

from cablefem.newmark import SCHEMES
from cablefem.scene import Groups
from cablefem.scene.errors import did_you_mean, short_text
from validation.core.solver import Solver


class Setting(NamedTuple):
    """A setting of a method: its default, and what it may be."""

    default: Any
    allowed: tuple[Any, ...] | tuple[float, float]  # choices for names, else (smallest, largest)
    meaning: str

    def validated(self, name: str, value: Any) -> Any:
        """The value in the default's type; ValueError, which gives the setting's name, if it is not allowed."""
        if isinstance(self.default, str):
            if value not in self.allowed:
                hint = did_you_mean(str(value), map(str, self.allowed))
                raise ValueError(f"{name} = {short_text(value)}: unknown.{hint}")
            return value
        kind = type(self.default)
        try:
            if isinstance(value, bool) or not isinstance(value, Real):
                raise TypeError
            number = kind(value)
            if kind is int and number != value:
                raise ValueError
        except (TypeError, ValueError, OverflowError):
            word = "an integer" if kind is int else "a number"
            raise ValueError(f"{name} must be {word}, got {value!r}") from None
        smallest, largest = self.allowed
        if not smallest <= number <= largest:
            raise ValueError(f"{name} must lie in [{smallest:g}, {largest:g}], got {value!r}")
        return number


TIME = {
    "steps": Setting(1000, (2, 1_000_000), "equal time steps from entry to exit"),
    "entry": Setting(1.0, (1e-9, 1.0), "first step as a fraction of the equal ones; the next grow by 15 percent each"),
    "exit": Setting(1.0, (1e-9, 1.0), "last step as a fraction of the equal ones"),
    "scheme": Setting("trapezoidal", SCHEMES, "time integration"),
    "newmark_gamma": Setting(0.6, (0.5, 1.5), "gamma of scheme=newmark; beta = (gamma + 1/2)^2/4"),
    "rho_inf": Setting(0.9, (0.0, 1.0), "spectral radius at infinite frequency of scheme=generalized-alpha"),
}
_MESH = {"grading": Setting(1.0, (1.0, 1e6), "largest over smallest element; the smallest ones are next to the mass")}

Build = Callable[..., Solver]


class Resolution(NamedTuple):
    """How a method is refined in space, and its cost."""

    setting: str
    max_value: int
    break_even: int  # arithmetic equals a step's fixed cost
    cost_exponent: float  # exponent of the arithmetic
    doubling: bool = False  # counts powers of two
    unknowns: Callable[[int], float] = float

    def refinement_ratio(self, coarse: int, fine: int) -> float:
        """How many times finer the value `fine` is than `coarse`."""
        return 2.0 ** (fine - coarse) if self.doubling else fine / coarse

    def scaled_to_nearest(self, value: int, ratio: float) -> int:
        """The value nearest to `ratio` times as fine."""
        if self.doubling:
            return max(0, value + round(math.log2(ratio)))
        return max(1, round(value * ratio))

    def scaled_at_least(self, value: int, ratio: float) -> int:
        """The smallest value at least `ratio` times as fine, up to `max_value`."""
        scaled = value + math.ceil(math.log2(ratio)) if self.doubling else math.ceil(value * ratio)
        return min(scaled, self.max_value)

    def step_cost_over_fixed_cost(self, value: int, resolution_ratio: float = 1.0) -> float:
        """Cost of a step at `resolution_ratio` times the resolution, over its fixed cost."""
        return 1.0 + (resolution_ratio * self.refinement_ratio(self.break_even, value)) ** self.cost_exponent

    def value_for_unknowns(self, unknowns: float) -> int:
        """The value with about so many unknowns in one field."""
        values = range(0 if self.doubling else 1, self.max_value + 1)
        return min(values, key=lambda value: abs(self.unknowns(value) - unknowns))


# Costs by `cablefem chart`: banded elements linear, dense bases square to cube.
ELEMENTS = Resolution("elements", 320, 8, 1.0)
TERMS = Resolution("terms", 160, 25, 2.5)
LEVELS = Resolution("level", 5, 1, 2.5, doubling=True, unknowns=lambda level: 7.0 * 2.0**level + 3.0)


@dataclass(frozen=True, slots=True)
class Method:
    """A discretisation with its settings and orders of error."""

    name: str
    wing: str  # "elements" | "galerkin": no formula in common
    title: str
    all_settings: dict[str, Setting]
    resolution: Resolution
    space_order: float  # of the path with a kink at the mass
    build: Build
    coarsest_settings: tuple[int, int]  # coarsest resolution with a readable error, and its steps
    settings_on_free_rides: dict[str, Any] = field(default_factory=dict)
    steps_exponent: float = 1.0  # power of the resolution with which steps grow
    advise_settings: tuple[tuple[int, int], ...] = ()  # for `cablefem advise`, coarse to fine
    atlas_settings: tuple[int, int] | None = None  # in `cablefem atlas`; None: not mapped
    use: str = ""  # when to use it
    wrong: bool = False  # does not converge to the answer

    @property
    def mesh_follows_mass(self) -> bool:
        """Whether the mesh follows the mass: then only waves limit the order in time."""
        return "grading" in self.all_settings

    @property
    def tells_waves_from_ripples(self) -> bool:
        """Whether waves slower than the mass, and compression at a point, can be told from ripples."""
        return self.wing == "elements" and self.space_order >= 2.0

    def settings_from_coarse_to_fine(self, count: int, first_ratio: float = 1.0) -> list[dict[str, Any]]:
        """Resolutions, each twice as fine, with steps that keep pace.

        first_ratio : the first over that of `coarsest_settings`.
        """
        first, steps = self.coarsest_settings
        space = self.resolution
        out = []
        for k in range(count):
            value = space.scaled_to_nearest(first, first_ratio * 2.0**k)
            more = space.unknowns(value) / space.unknowns(first)
            out.append({space.setting: value, "steps": round(steps * more**self.steps_exponent)})
        return out

    def settings_for_scene(self, groups: Groups, changes: dict[str, Any]) -> dict[str, Any]:
        """All settings for a scene, with changes.  On free rides rules damp: force jumps ring on.

        Raises ValueError like `complete_settings`.
        """
        rule: dict[str, Any] = {}
        if self.all_settings["scheme"].default == "trapezoidal" and groups.drive.mode == "free":
            rule = {"scheme": "generalized-alpha"} | self.settings_on_free_rides
        return self.complete_settings(rule | changes)

    def complete_settings(self, changes: dict[str, Any]) -> dict[str, Any]:
        """The defaults with `changes`; ValueError for unknown names and values, one line each."""
        out = {name: setting.default for name, setting in self.all_settings.items()}
        faults = []
        for name, value in changes.items():
            try:
                if name not in self.all_settings:
                    raise ValueError(f"{self.name} has no setting {name!r}.{did_you_mean(name, self.all_settings)}")
                out[name] = self.all_settings[name].validated(name, value)
            except ValueError as fault:
                faults.append(str(fault))
        if faults:
            raise ValueError("\n".join(faults))
        return out

    def resolution_value(self, settings: dict[str, Any]) -> int:
        return settings[self.resolution.setting]

    def resolution_and_steps(self, settings: dict[str, Any]) -> dict[str, Any]:
        """These two of all settings."""
        return {name: settings[name] for name in (self.resolution.setting, "steps")}


CHECKED = ("following-p2", "fourier-kink")  # the method of each wing that `check` runs
# Solvers are imported when built: names load without scikit-fem.


def _build_following_elements(degree: int, groups: Groups, settings: dict[str, Any], **options: str) -> Solver:
    from cablefem.elements.rolling import make_following_elements

    mesh = {name: settings[name] for name in ("elements", *_MESH)}
    return make_following_elements(groups, degree=degree, **mesh, **options)


def _build_fixed_elements(
    element: str, coupling: str, groups: Groups, settings: dict[str, Any], **options: str
) -> Solver:
    from cablefem.elements.fixed import FixedElements

    return FixedElements(groups, elements=settings["elements"], element=element, coupling=coupling, **options)


def _build_galerkin(family: str, kink: bool, groups: Groups, settings: dict[str, Any], **options: Any) -> Solver:
    from galerkin.abscissa import SystemOverPosition
    from galerkin.bases.daubechies import Daubechies
    from galerkin.bases.fourier import Fourier
    from galerkin.equations import GalerkinSystem
    from galerkin.rides import RollingSystem

    free = groups.drive.mode == "free"
    system = RollingSystem if groups.drive.mode != "grip" else GalerkinSystem
    if family == "wavelet":
        wavelets = Daubechies(**{name: settings[name] for name in _WAVELETS})
        solver: Any = system(groups, wavelets, kink=kink, **options)
    else:
        graded = free and kink and settings["terms"] > 1  # graded sums use the second sine; waves ahead are short
        solver = system(groups, Fourier(settings["terms"], 0.8 if graded else 0.0), kink=kink, **options)
    return SystemOverPosition(solver) if settings["abscissa"] == "s" else solver


def _element_resolution(unknowns_per_element: int) -> Resolution:
    return ELEMENTS._replace(unknowns=lambda elements: float(unknowns_per_element * elements))


def _settings_of_following_mesh(default_elements: int) -> dict[str, Setting]:
    elements = Setting(default_elements, (1, 100_000), "elements on each side of the mass")
    return {"elements": elements, **_MESH, **TIME}


_TERMS = {"terms": Setting(30, (1, 2000), "sines")}
_WAVELETS = {
    "order": Setting(4, (2, 8), "Daubechies order p (2p filter taps)"),
    "level": Setting(1, (0, 8), "levels J; the number of wavelets is 2^J (2p - 1) + p - 1"),
    "reading": Setting(
        "literal", ("literal", "scaling", "shifted"), "of the printed index set (37); the other two are known to fail"
    ),
}
_ABSCISSA = {"abscissa": Setting("t", ("t", "s"), "independent variable: time, or place of the mass (45)-(48)"), **TIME}
_MANY_STEPS = Setting(4000, (2, 1_000_000), TIME["steps"].meaning)
_UNIFORM_MESH = {"elements": Setting(40, (2, 100_000), "elements on the whole cable"), **TIME}
# A constraint on positions needs a rule implicit at a step's end.
_CONSTRAINED = tuple(x for x in SCHEMES if x not in ("gauss", "central-difference"))
_DAMPED = _UNIFORM_MESH | {"scheme": Setting("newmark", _CONSTRAINED, TIME["scheme"].meaning)}

_ALL = (
    Method(
        "following-p1", "elements", "linear elements on a mesh that follows the mass",
        _settings_of_following_mesh(20), _element_resolution(2), 2.0, partial(_build_following_elements, 1), (10, 400),
        advise_settings=((5, 80), (9, 150), (16, 300), (30, 600), (55, 1200)),
        use="robust and simple; P2 gives more for the same time",
    ),
    Method(
        "following-p2", "elements", "quadratic elements on a mesh that follows the mass",
        _settings_of_following_mesh(10), _element_resolution(4), 2.5, partial(_build_following_elements, 2), (4, 200),
        settings_on_free_rides={"elements": 36, "scheme": "radau"}, steps_exponent=1.25, atlas_settings=(8, 600),
        advise_settings=((4, 80), (6, 150), (9, 300), (13, 600), (20, 1200)),
        use="the default: fastest for a given error from 1e-2 to 1e-5",
    ),
    Method(
        "following-p4", "elements", "elements of degree 4 on a mesh that follows the mass",
        _settings_of_following_mesh(5), _element_resolution(8), 2.5, partial(_build_following_elements, 4), (2, 200),
        settings_on_free_rides={"scheme": "radau"}, steps_exponent=1.25,
        use="smooth travel (from rest); wave fronts of a sudden entry take its advantage away",
    ),
    Method(
        "fixed-hermite", "elements", "C1 cubic elements, the mass moving through them",
        _UNIFORM_MESH | {"steps": _MANY_STEPS}, _element_resolution(2), 1.0,
        partial(_build_fixed_elements, "hermite", "chain"), (8, 800), steps_exponent=3.0,
        use="first order, and N'' jumps at the nodes: wants steps like the square of the elements",
    ),
    Method(
        "fixed-p1-path", "elements", "linear elements, the mass a particle constrained to them",
        _DAMPED, _element_resolution(1), 1.0, partial(_build_fixed_elements, "p1", "path"), (10, 250),
        atlas_settings=(30, 600),
        use="only with numerical damping: the undamped rule blows up",
    ),
    Method(
        "fixed-p1-naive", "elements", "linear elements with chain-rule accelerations: WRONG",
        _UNIFORM_MESH, _element_resolution(1), 0.0, partial(_build_fixed_elements, "p1", "naive"), (10, 250),
        wrong=True,
        use="never: the centrifugal force is lost at the nodes; on show because everybody writes it first",
    ),
    Method(
        "fourier", "galerkin", "the paper's sines (33)-(34)",
        _TERMS | _ABSCISSA, TERMS, 1.0, partial(_build_galerkin, "fourier", False), (8, 320), atlas_settings=(30, 600),
        use="the paper's method; errors of order 1/N, tension with Gibbs oscillations",
    ),
    Method(
        "fourier-kink", "galerkin", "sines and a hat that travels with the mass",
        _TERMS | _ABSCISSA, TERMS, 2.0, partial(_build_galerkin, "fourier", True), (5, 500),
        settings_on_free_rides={"terms": 45, "steps": 3000, "rho_inf": 0.7}, atlas_settings=(16, 600),
        advise_settings=((6, 50), (10, 100), (14, 170), (20, 300), (30, 600), (50, 1200)),
        use="the Galerkin default, and its only method for cars that roll; ten terms beat 200 plain ones",
    ),
    Method(
        "wavelet", "galerkin", "the paper's anti-derivatives of Daubechies wavelets (35)-(39)",
        _WAVELETS | _ABSCISSA, LEVELS, 1.0, partial(_build_galerkin, "wavelet", False), (0, 400),
        use="the paper's method; first order like sines, oscillations stay near the mass",
    ),
)  # fmt: skip
METHODS = {m.name: m for m in _ALL}
ENTRY_POINTS = "cablefem.methods"  # group in which another package names its methods


def find_method(name: str | Method) -> Method:
    """The method of this name, ours or that of an entry point, or itself; ValueError for an unknown one."""
    if isinstance(name, Method):
        return name
    name = str(name)
    if name in METHODS:
        return METHODS[name]
    others = methods_of_other_packages()
    if name not in others:
        raise ValueError(f"unknown method {name!r}.{did_you_mean(name, [*METHODS, *others])}")
    return others[name]


def methods_of_other_packages() -> dict[str, Method]:
    """Methods that other packages give by entry points; ValueError for what is none."""
    methods = {}
    for point in entry_points(group=ENTRY_POINTS):
        try:
            method = point.load()
        except Exception as error:  # of any kind: it is not our code
            raise ValueError(f"method {point.name}: {point.value} cannot be loaded ({error})") from None
        if not isinstance(method, Method) or method.name != point.name or method.name in METHODS:
            raise ValueError(f"method {point.name}: {point.value} must be a new Method with this name")
        methods[point.name] = method
    return methods


def scaled_settings(
    method: Method, settings: dict[str, Any], *, space: float = 1.0, time: float = 1.0
) -> dict[str, Any]:
    """Settings at `space` times the resolution, `time` times the steps; also coarser ones."""
    out = dict(settings)
    resolution = method.resolution
    smallest = method.all_settings[resolution.setting].allowed[0]
    if space != 1.0:
        value = resolution.scaled_to_nearest(method.resolution_value(settings), space)
        out[resolution.setting] = max(smallest, value)
    out["steps"] = max(2, round(settings["steps"] * time))
    return out
