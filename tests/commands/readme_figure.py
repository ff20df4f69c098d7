"""Draw the README's figure from its own zip line: `python tests/commands/readme_figure.py` after `pip install -e .`."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from cablefem import Scene
from validation.commands.check.study import check
from validation.page.figures import STYLE

HERE = Path(__file__).parents[2]
RIDERS = {60.0: "#0072b2", 95.0: "#d55e00", 120.0: "#009e73"}  # kg


def main() -> None:
    text = re.search(r"```toml\n(title = .*?)```", (HERE / "README.md").read_text(encoding="utf-8"), re.S).group(1)
    scene = Scene.model_validate(tomllib.loads(text))
    plt.rcParams.update(STYLE | {"svg.fonttype": "path"})
    fig, (height, speed, tension) = plt.subplots(
        3, 1, figsize=(8.4, 6.6), sharex=True, height_ratios=(1.3, 1.0, 1.0), layout="constrained"
    )
    for mass, colour in RIDERS.items():
        found = check(Scene.model_validate(tomllib.loads(text.replace("mass = 95.0", f"mass = {mass}"))))
        for run, line in ((found.a.run, "-"), (found.b.run, ":")):
            look = {"color": colour, "linestyle": line, "linewidth": 1.6 if line == "-" else 3.0}
            label = f"{mass:g} kg, {run.method}"
            height.plot(run.x, -run.y, **look)
            speed.plot(run.x, 3.6 * run.speed, label=label, **look)
            tension.plot(run.x, 1e-3 * np.maximum(run.T_behind, run.T_ahead), **look)
    s = np.linspace(0.0, scene.length, 201)
    height.plot(scene.catenary.x(s), -scene.catenary.y(s), color="#888", linewidth=1.0)
    height.text(196.0, -17.6, "empty cable", color="#666666", fontsize=9)
    height.text(281.5, -3.5, "brake", color="#666666", fontsize=9)
    for ax, name in ((height, "height [m]"), (speed, "speed [km/h]"), (tension, "tension [kN]")):
        ax.set_ylabel(name)
        ax.axvline(280.0, color="#bbb", linewidth=0.8, zorder=0)
    fig.legend(*speed.get_legend_handles_labels(), ncol=3, fontsize=9, loc="outside upper center")
    tension.set_xlabel("place along the line [m]")
    fig.savefig(HERE / "validation/page/assets/readme.svg", metadata={"Date": None})


if __name__ == "__main__":
    main()
