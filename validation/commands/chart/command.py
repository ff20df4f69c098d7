from validation.page.options import Out, SceneName, scene_named, study

PLACE = 7
EXAMPLE = "cablefem chart level"


def command(scene: SceneName, out: Out = None) -> int:
    """Chart speed against accuracy of every method on a scene.

    Writes DIR/: chart.json and report.html.
    """
    loaded = scene_named(scene, travelling=True)

    from validation.commands.chart.study import chart

    study("chart", loaded, ["chart.json"], out, chart, loaded)
    return 0
