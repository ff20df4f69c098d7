"""A user's own solver, as small as one can be: sines on a taut string, its moving mass by the chain rule."""

import numpy as np


def string(scene, *, coriolis=True, terms=40, steps=600):
    """Mass path (s_o, v) [m] of the linear taut string along the chord: the model "string".

    M = I/2 + mu phi phi^T, C = 2 mu ds phi phi'^T, K = tau diag(n pi)^2/2 + mu phi (ds^2 phi'' + dds phi')^T and the
    weight mu sigma chord_cos less the acceleration of the static parabola; trapezoidal rule.
    """
    g = scene.groups
    tau, weight = 1.0 / g.chord_cos, g.sigma * g.chord_cos
    k = np.pi * np.arange(1, terms + 1)
    t = np.linspace(0.0, g.motion.phases[-1][1], steps + 1)
    h, s_o = t[1], g.motion.position(t)
    dds = np.gradient(ds := np.gradient(s_o, t, edge_order=2), t, edge_order=2)

    def at(i):
        phi, d1, d2 = np.sin(k * s_o[i]), k * np.cos(k * s_o[i]), -(k**2) * np.sin(k * s_o[i])
        bent = -(ds[i] ** 2) * weight / tau + dds[i] * weight / tau * (0.5 - s_o[i])
        return (
            0.5 * np.eye(terms) + g.mu * np.outer(phi, phi),
            2.0 * g.mu * ds[i] * np.outer(phi, d1) * coriolis,
            0.5 * tau * np.diag(k**2) + g.mu * np.outer(phi, ds[i] ** 2 * d2 + dds[i] * d1),
            g.mu * phi * (weight - bent),
        )

    q, v = np.zeros(terms), np.zeros(terms)
    M, _, _, F = at(0)
    a, w = np.linalg.solve(M, F), [0.0]
    for i in range(1, steps + 1):
        M, C, K, F = at(i)
        q_p, v_p = q + h * v + 0.25 * h * h * a, v + 0.5 * h * a
        a = np.linalg.solve(M + 0.5 * h * C + 0.25 * h * h * K, F - C @ v_p - K @ q_p)
        q, v = q_p + 0.25 * h * h * a, v_p + 0.5 * h * a
        w.append(np.sin(k * s_o[i]) @ q)
    return scene.length * s_o, scene.length * g.chord_cos * np.array(w)


def without_coriolis(scene):
    """The classical slip: 2 mu ds phi phi' forgotten."""
    return string(scene, coriolis=False)
