"""What both solvers use, so that the check cannot see its faults; each has a check of its own."""

SHARED = (
    ("scene and its groups", "round trip and identities over random scenes"),
    ("static catenary", "put into its differential equation; equilibrium of elements in absolute coordinates"),
    ("travel s_o(t)", "derivatives against differences; events at jumps of acceleration"),
    ("Newmark driver", "exact recurrence of an oscillator; scipy's Radau and DOP853 on the same system"),
    ("sampling and units", "responses of both solvers against exact answers (cablefem oracles)"),
)
