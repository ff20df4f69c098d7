"""The string around a mass whose path an exact answer gives: what holds it against the wave equation."""

import math

import numpy as np
from scipy.optimize import brentq
from scipy.special import lambertw

from validation.oracles import moving_mass


def displacement(ride, x, t):
    """v(x, t) of a `moving_mass.Ride` for t >= 0, also after the mass has left over the far support."""
    left, right, is_left = _waves(ride, x, t, False)
    return np.where(is_left, left[0] - left[1], right[0] - right[1])


def gradient(ride, x, t):
    """(v_x, v_t) away from fronts; at the mass the side behind it."""
    left, right, is_left = _waves(ride, x, t, True)
    v_x = np.where(is_left, left[0] + left[1], -right[0] - right[1])
    return v_x, np.where(is_left, left[0] - left[1], right[0] - right[1])


def approach(ride, s):
    """(y, I) at t = t_end - s, without cancellation for the smallest s > 0."""
    s = np.atleast_1d(np.asarray(s, float))
    y, F, G = ride._march.past.at(ride.travel.t_end - s, s).T
    return y, 2.0 * (F + G - y)


def _waves(ride, x, t, derivative):
    """f(t+x), f(t-x) and g(t-x), g(t+x-2) (or derivatives), and where the first pair is the one that counts."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    T = ride.travel.t_end
    is_left = (t >= T) | (x <= ride.travel.position(np.minimum(t, T)))
    f = [_f(ride, w, derivative) for w in (t + x, t - x)]
    g = [_g(ride, z, derivative) for z in ((T - t) - (1.0 - x), (T - t) + (1.0 - x))]
    return f, g, is_left


def _f(ride, eta, derivative):
    """f(eta); after the arrival the string is fixed at x = 1 again and f has period 2."""
    march, T = ride._march, ride.travel.t_end
    last = march.B(np.array([T]))[0]
    shape, out = eta.shape, np.zeros(eta.size)
    eta = np.where(eta > last, eta - 2.0 * np.ceil((eta - last) / 2.0), eta).ravel()
    on = eta > march.B0
    tau = np.minimum(march.back(eta[on]), ride.t_last)
    out[on] = march.past.at(tau, T - tau, derivative)[:, 1]
    if derivative:
        out[on] /= 1.0 + ride.travel.speed(tau)
    return out.reshape(shape)


def _g(ride, zeta, derivative):
    """g(T - 1 - zeta)."""
    march, T, flat = ride._march, ride.travel.t_end, zeta.ravel()
    out = np.zeros(flat.size)
    on = (flat < march.zeta0) & (flat > -ride.travel.to_go(np.zeros(1))[0])
    rest = np.maximum(march.ahead(flat[on]), T - ride.t_last)
    out[on] = march.past.at(T - rest, rest, derivative)[:, 2]
    if derivative:
        out[on] /= 1.0 - ride.travel.speed(T - rest)
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


def coasting_speed(t, *, mu, sigma, w0):
    """xi'(t) without drive in closed form: E/mu = mu sigma^2 [ t + mu expm1(-2t/mu) - (mu/4) expm1(-4t/mu) ]."""
    e = mu * sigma**2 * (t + mu * np.expm1(-2.0 * t / mu) - 0.25 * mu * np.expm1(-4.0 * t / mu))
    return np.sqrt(-lambertw(-(w0**2) * np.exp(-(w0**2) - e)).real)


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
