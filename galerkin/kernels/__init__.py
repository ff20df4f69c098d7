"""Compiled steps of the full cable over sines; loops compile faster than array expressions.

phi (n, m): Phi' at the points; x: a `InertiaTerms`; Q, V, A (2, n): coefficients and rates.
"""

from galerkin.kernels.bodies import (
    ANCHOR,
    BODY,
    COUNTERWEIGHT,
    POINT_CAR,
    SADDLE,
    SPRING,
    TROLLEY,
    forces_on_car,
)
from galerkin.kernels.cable import (
    Cable,
    Points,
    force_energy_and_tangent,
    set_stiffness_matrix,
    smoothed_min_tension_and_position,
)
from galerkin.kernels.instant import CableSines
from galerkin.kernels.line import (
    FOLLOWER,
    ON_RAIL,
    Coordinates,
    Line,
    LineValues,
    Tables,
    evaluate_line,
    evaluate_line_with_unknowns,
    set_dependent_coordinates,
    set_points_and_tensions,
)
from galerkin.kernels.line_derivatives import evaluate_line_and_set_derivatives
from galerkin.kernels.line_march import LineInSteps, take_steps_while_factors_serve
from galerkin.kernels.rolling import MIN_TENSION
from galerkin.kernels.steps import (
    StepsTaken,
    set_residual_and_derivatives,
    set_side_forces_and_strain_energies,
    solve_steps,
)
