from validation.page import terminal
from validation.page.options import Out, SceneName, load_scene_printing_notes_or_refuse, run_and_report_study

EXAMPLE = "cablefem modes bare"


def command(scene: SceneName, out: Out = None) -> int:
    """Print the first ten frequencies of the cable alone.

    From both solvers and the exact theory, omega l sqrt(rho/H). Writes DIR/: modes.json and report.html.
    """
    loaded = load_scene_printing_notes_or_refuse(scene)

    from validation.commands.modes.study import modes
    from validation.page import printing

    result = run_and_report_study("modes", loaded, ["modes.json"], out, modes, loaded)
    rows = []
    for i, hertz in enumerate(result.hertz):
        frequencies = [f"{omega[i]:.7f}" for omega in result.omega.values()]
        rows.append([str(i + 1), f"{hertz:.5g}", *frequencies])
    heads = ["mode", "Hz", *result.omega]
    terminal.print_table(heads, rows, right=heads)
    terminal.print_text()
    printing.print_agreements(result.rows)
    return 0 if all(row.verdict.value == "agree" for row in result.rows) else 1
