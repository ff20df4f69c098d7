import numpy as np

from cablefem.response import Response
from validation.core import foreign, measures
from validation.core.agreement import Agreement, Bound, BoundPart, Verdict
from validation.core.foreign import ForeignPath
from validation.core.measures import NotComparable, Window

Answer = Response | ForeignPath


def assert_agree(
    a: Answer, b: Answer, *, path: float = 1e-3, tension: float | None = None, window: Window | None = None
) -> list[Agreement]:
    """Raise AssertionError unless two answers agree in mass path and, if asked, tension; return the rows.

    path : largest path gap, over the largest deflection of b; of a free ride 0.1 l.
    tension : rms gap of the tension fields, or at the mass, over H.
    window : s_o/l, by default that of the drive; cut at slack and where an answer ends.
    assert_agree(run("level"), run("level", "fourier-kink"), path=3e-3)
    """
    __tracebackhide__ = True  # pytest shows the caller's line
    names = f"{a.method} and {b.method}"
    if not np.isclose(a.length, b.length, rtol=1e-6, atol=0.0):
        raise AssertionError(f"{names} are of different cables: {a.length:.6g} m and {b.length:.6g} m long")
    try:
        cut = _comparable_window(a, b, window or measures.WINDOWS[a.drive])
        rows = [_path_row(a, b, path, cut)]
        if tension is not None:
            rows.append(_tension_row(a, b, tension, cut))
    except NotComparable as reason:
        raise AssertionError(f"{names} cannot be compared: {reason}") from None
    failed = [row for row in rows if row.verdict is not Verdict.AGREE]
    if failed:
        raise AssertionError("\n".join([f"{names} disagree", *(f"  {agreement_text(row)}" for row in failed)]))
    return rows


def agreement_text(row: Agreement) -> str:
    where = "" if row.where is None else f", largest at s_o/l = {row.where:.3f}"
    return f"{row.quantity}: gap {row.gap:.3g}, allowed {row.allowed:.3g}{where}; {row.allowed_because}"


def _comparable_window(a: Answer, b: Answer, window: Window) -> Window:
    start, end = window
    if a.drive != "free":
        start = max(start, *(float(x.s_o[0] / x.length) for x in (a, b)))
    return measures.common_window(a, b, window=(start, end))


def _window_text(window: Window, a: Answer, b: Answer) -> str:
    onsets = [x.slack_onset for x in (a, b) if x.slack_onset is not None]
    cut = ", cut at the slack onset" if onsets and window[1] == min(onsets) else ""
    return f"s_o/l {window[0]:.3g} to {window[1]:.3g}{cut}"


def _path_row(a: Answer, b: Answer, allowed: float, window: Window) -> Agreement:
    x, y = (a, b) if a.u is not None and b.u is not None else map(foreign.without_u, (a, b))
    gap, rms, where = measures.path_gap(x, y, window)
    _, positions, distances = measures.path_distances(x, y, window)
    why = [f"relative to {b.path_scale_named} {b.path_scale:.4g} m"]
    beyond = positions[distances > allowed]
    if beyond.size:
        why.append(f"they part from s_o/l = {beyond[0]:.3f} on")
    why += [f"rms gap {rms:.3g}", f"over {_window_text(window, a, b)}"]
    for r in (a, b):
        if isinstance(r, Response) and r.path_error is not None:
            why.append(f"error bar of {r.method} {r.path_error:.2g}")
    bound = Bound("asked for", (BoundPart("path", allowed),), "; ".join(why))
    return Agreement("path_max", gap, bound, where)


def _tension_row(a: Answer, b: Answer, allowed: float, window: Window) -> Agreement:
    if isinstance(a, Response) and isinstance(b, Response):
        gap = measures.tension_gap(a, b, window)
        frames, _, _ = measures.common_frames(a, b, window)
        worst = max(frames.tolist(), key=lambda frame: measures.tension_gap(a, b, (frame, frame)))
        why = f"rms of the field off the mass, over H; over {_window_text(window, a, b)}"
    else:
        for r in (a, b):
            if r.T_behind is None:
                raise NotComparable(f"{r.method} brought no tension")
        H = next(r.horizontal_tension for r in (b, a) if isinstance(r, Response))
        gap = foreign.mass_tension_gap(a, b, window, H)
        worst = None
        why = "rms at the mass, both sides, relative to H"
    return Agreement("tension", gap, Bound("asked for", (BoundPart("tension", allowed),), why), worst)
