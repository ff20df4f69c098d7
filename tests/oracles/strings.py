"""The string around a mass whose path an exact answer gives: what holds it against the wave equation."""

import math

import numpy as np
from scipy.optimize import brentq

from validation.oracles import moving_mass


def displacement(ride, x, t):
    """v(x, t) of a `moving_mass.Ride` for t >= 0, also after the mass has left over the far support."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    T = ride.travel.t_end
    left = _f(ride, t + x) - _f(ride, t - x)
    right = _g(ride, (T - t) - (1.0 - x)) - _g(ride, (T - t) + (1.0 - x))
    return np.where((t >= T) | (x <= ride.travel.position(np.minimum(t, T))), left, right)


def _f(ride, eta):
    """f(eta); after the arrival the string is fixed at x = 1 again and f has period 2."""
    march, T = ride._march, ride.travel.t_end
    last = march.B(np.array([T]))[0]
    shape, out = eta.shape, np.zeros(eta.size)
    eta = np.where(eta > last, eta - 2.0 * np.ceil((eta - last) / 2.0), eta).ravel()
    on = eta > march.B0
    tau = np.minimum(march.back(eta[on]), ride.t_last)
    out[on] = march.past.at(tau, T - tau)[:, 1]
    return out.reshape(shape)


def _g(ride, zeta):
    """g(T - 1 - zeta)."""
    march, T, flat = ride._march, ride.travel.t_end, zeta.ravel()
    out = np.zeros(flat.size)
    on = (flat < march.zeta0) & (flat > -ride.travel.to_go(np.zeros(1))[0])
    rest = np.maximum(march.ahead(flat[on]), T - ride.t_last)
    out[on] = march.past.at(T - rest, rest)[:, 2]
    return out.reshape(zeta.shape)


# --- travels in closed form


def from_rest(a):
    """xi = a t^2/2; below the wave speed all along for a < 1/2."""
    return moving_mass.Travel(lambda t: 0.5 * a * t * t, lambda t: a * np.asarray(t), math.sqrt(2.0 / a))


def accelerate_cruise_brake(V):
    """In closed form: from rest to V on the first third, at V on the second, to rest on the last (the paper's (40))."""
    ta, tb, T, a = 2.0 / (3.0 * V), 1.0 / V, 5.0 / (3.0 * V), 1.5 * V * V

    def position(t):
        return np.where(t < ta, 0.5 * a * t * t, np.where(t < tb, V * t - 1.0 / 3.0, 1.0 - 0.5 * a * (T - t) ** 2))

    def speed(t):
        return np.where(t < ta, a * t, np.where(t < tb, V, a * (T - t)))

    return moving_mass.Travel(position, speed, T, (ta, tb))


# --- a mass that slides on an infinite string, `wave_drag`


def sliding(ride, x, t):
    """v(x, t) = y(tau), tau the time at which the wave now at x left the mass; 0 <= t <= t_end."""
    return np.where((tau := _left_at(ride, x, t)) > 0.0, ride.path(tau), 0.0)


def sliding_gradient(ride, x, t):
    """(v_x, v_t) off the mass."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    tau = _left_at(ride, x, t)
    w, half = ride.speed(np.maximum(tau, 0.0)), np.where(tau > 0.0, 0.5 * ride.force(np.maximum(tau, 0.0)), 0.0)
    ahead = x > ride.position(t)
    v_t = half / np.where(ahead, 1.0 - w, 1.0 + w)
    return np.where(ahead, -v_t, v_t), v_t


def _left_at(ride, x, t):
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    out = np.zeros(x.size)
    for i, (xi, ti) in enumerate(zip(x.flat, t.flat, strict=True)):
        sign = 1.0 if xi > ride.position(ti) else -1.0  # ahead: tau - xi(tau) = t - x, behind: tau + xi(tau) = t + x
        target = ti - sign * xi
        if target > 0.0:
            out[i] = brentq(lambda u, s=sign, c=target: u - s * float(ride.position(u)) - c, 0.0, float(ti), rtol=1e-14)
    return out.reshape(x.shape)


# --- modes and series


def symmetric_mode(s, W):
    """Shape of a flat cable's symmetric mode of frequency W: 1 - cos(W s) - tan(W/2) sin(W s)."""
    s = np.asarray(s, float)
    return 1.0 - np.cos(W * s) - math.tan(0.5 * W) * np.sin(W * s)


def force_series(x, t, *, P, V, terms):
    """Fryba's sine series of v(x, t) while the force is on the string; V != 1 (each term is resonant there)."""
    k = np.pi * np.arange(1, terms + 1)
    xk, tk = x[..., None] * k, t[..., None] * k
    return 2.0 * P / (1.0 - V * V) * np.sum(np.sin(xk) / k**2 * (np.sin(V * tk) - V * np.sin(tk)), axis=-1)
