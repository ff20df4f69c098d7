"""The time loop of all solvers; it knows no physics."""

from cablefem.newmark.collocation import collocate_first_step
from cablefem.newmark.equilibrium import quasi_static_start
from cablefem.newmark.failures import EndlessEvents, NewtonStalled, StepFailure, StepUnderflow
from cablefem.newmark.march import integrate, integrate_blocks
from cablefem.newmark.marching import MarchingSystem, StepsWithFactors
from cablefem.newmark.newton import Newton, StepResult
from cablefem.newmark.schemes import SCHEMES, Scheme, scheme
from cablefem.newmark.states import (
    Array,
    Collocated,
    Inside,
    State,
    StateBlock,
    StateHistory,
    States,
    Steps,
    stack_states,
)
from cablefem.newmark.stepper import PassedEvent, Work
from cablefem.newmark.steps import step_times_by_phase
from cablefem.newmark.system import (
    ACCELERATION_ONLY,
    NO_STEPS,
    ManySteps,
    Solve,
    System,
    TangentFactors,
    consistent_acceleration,
    take_newmark_step,
)
from cablefem.newmark.tableau import Tableau, interpolate_hermite, state_inside_step, with_states_inside_steps
