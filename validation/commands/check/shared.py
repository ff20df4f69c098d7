"""What both solvers use, so that their gap cannot show its faults; each has a check of its own."""

SHARED = (
    ("scene and its groups", "laws in SI, from the numbers of the scene file alone; round trip over random scenes"),
    ("static catenary", "laws in SI: ends, length, sag, forces at rest; --deep: exact frequencies"),
    ("travel s_o(t)", "laws in SI: the travel of the scene file; derivatives against differences"),
    ("time driver", "momentum, energy, power in SI; --deep: scipy on the same system; recurrence of an oscillator"),
    ("sampling and units", "laws in SI: momentum in N s, work in J; exact answers (cablefem oracles)"),
    (
        "entry: free fall with speed, a strained start from rest",
        "momentum over the first windows; --deep: what a smooth entry would change",
    ),
    ("chord models of one field", "the full cable (cablefem advise); exact answers of the taut string"),
    (
        "slack: switch of the law and its damping",
        "paths past the onset with bars of their own; no compression then; --deep: another damping",
    ),
    (
        "drive: grip, haul or free",
        "place, thrust, tensions, work in SI; --deep: statics at the start; a gripping car beside a hauled one",
    ),
    (
        "stick and slip of a car that rolls",
        "friction, brakes, places of events and of rest in SI; exact rides on an incline (cablefem oracles)",
    ),
    ("window of comparison", "a range that ends early is a verdict of its own; paths past it while both know them"),
    (
        "how bars are made: half the resolution, half the steps",
        "--deep: degree 4 in twice the steps; finer runs of random scenes (cablefem sweep)",
    ),
)
