from validation.page.options import Out, SceneName, scene_named, study

EXAMPLE = "cablefem certify level"


def command(scene: SceneName, out: Out = None) -> int:
    """Compute the mass path as deep as it goes, with a bar at 101 places.

    Two element discretisations that differ in degree and scheme, the Galerkin wing, and the exact taut string; held
    against the shipped table of the scene, if there is one. Of a free ride, when it passes a place has a bar as well.
    Minutes. Writes DIR/: certificate.csv, certify.json and report.html.
    """
    loaded = scene_named(scene, travelling=True)

    from validation.commands.certify import study as certificates
    from validation.page import telling

    made = study("certify", loaded, ["certificate.csv", "certify.json"], out, certificates.certify, loaded)
    telling.rows(made.rows)
    return 0 if made.verdict == "agree" else 1
