"""Strings around a mass, modes and series: what holds exact answers against their equations."""

import math

import numpy as np


def displacement(motion, impulse, x, t, *, mirror=-1.0):
    """v(x, t) between fixed ends by images; impulse(t) of a force that stays below the wave speed, 0 at t = 0."""
    x, t = np.broadcast_arrays(np.asarray(x, float), np.asarray(t, float))
    total, images = np.zeros(x.shape), math.ceil(0.5 * t.max()) + 1
    for way in 2.0 * np.arange(-images, images + 1):
        for sign in (1.0, mirror):
            side = math.copysign(1.0, sign)
            low, high = np.zeros(x.shape), t.copy()  # the last time at which an image sends what is heard at t
            for _ in range(60):
                middle = 0.5 * (low + high)
                heard = np.abs(x - way - side * motion.position(middle)) <= t - middle
                low, high = np.where(heard, middle, low), np.where(heard, high, middle)
            total += 0.5 * sign * impulse(low)
    return total


# --- modes and series


def symmetric_mode(s, W):
    """Shape of a flat cable's symmetric mode of frequency W: 1 - cos(W s) - tan(W/2) sin(W s)."""
    s = np.asarray(s, float)
    return 1.0 - np.cos(W * s) - math.tan(0.5 * W) * np.sin(W * s)
