"""The one time loop of all solvers; it knows no physics.

A discretised system is r(t, q, v, a) = 0 with v = dq/dt and a = dv/dt.  The loop asks it for residuals and for
solutions with a tangent; matrix formats stay with the system.  Time and all quantities are the system's own.

    system    what a system answers
    schemes   every time integration by name
    stepper   what the rules of a step share; newmark_rule, energy_rule and
              collocation_rule (with its tableau) are the rules
    newton    Newton's method
    steps     the instants to step on
    events    finding where a watched value falls to zero, and passing it
    march     step after step: phases, cut steps, events
    course    many states
    failures  how a run may end
"""

from cablefem.newmark.collocation_rule import Collocating, collocate
from cablefem.newmark.course import NO_STEPS, Course, Stacked, Stretch
from cablefem.newmark.energy_rule import Averaged, average
from cablefem.newmark.events import Watched
from cablefem.newmark.failures import EndlessEvents, NewtonStalled, StepFailure, StepUnderflow
from cablefem.newmark.march import integrate, stretches
from cablefem.newmark.newmark_rule import iterate
from cablefem.newmark.newton import Newton, Settled
from cablefem.newmark.schemes import SCHEMES, Scheme, scheme
from cablefem.newmark.stepper import Passed, Work
from cablefem.newmark.steps import step_times
from cablefem.newmark.system import (
    Abrupt,
    Array,
    Collocated,
    Inside,
    Paced,
    Prepared,
    Ringing,
    Solve,
    State,
    System,
    Travelling,
    consistent_acceleration,
)
from cablefem.newmark.tableau import Tableau, between, cubic, densified
