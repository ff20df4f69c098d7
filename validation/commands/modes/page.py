"""Frequencies of the bare cable, from stored results."""

from pathlib import Path

from validation.core import store
from validation.page.page import Section, table

EXACT = "exact"


def sections(folder: Path) -> list[Section]:
    omega = store.read(folder / "modes.json")
    exact = omega[EXACT]
    gaps = {
        name: max(abs(x / y - 1.0) for x, y in zip(values, exact, strict=True))
        for name, values in omega.items()
        if name != EXACT
    }
    rows = [{"mode": i + 1} | {name: f"{values[i]:.7f}" for name, values in omega.items()} for i in range(len(exact))]
    worst = max(gaps, key=lambda name: gaps[name])
    caption = "Circular frequencies of the cable without its mass, times l sqrt(rho/H). Exact: linearised catenary."
    found = f"first {len(exact)} frequencies: at most {gaps[worst]:.1g} from the exact ones ({worst})"
    html = table(rows, ["mode", *omega], caption=caption)
    return [Section("modes-frequencies", "Frequencies of the bare cable", html, None, found)]
