"""Shortest ways of a car that drives ahead and backwards, as a reference.

Reeds and Shepp: Optimal paths for a car that goes both forwards and backwards, Pacific Journal of
Mathematics 145(2), 1990. Formulas 8.1 to 8.11 there, with all changes of time and side.
"""

from __future__ import annotations

import math
from collections.abc import Iterator


def _polar(x: float, y: float) -> tuple[float, float]:
    return math.hypot(x, y), math.atan2(y, x)


def _mod(angle: float) -> float:
    """An angle from −π to π."""
    return math.remainder(angle, 2.0 * math.pi)


def _words(x: float, y: float, phi: float) -> Iterator[tuple[float, ...]]:
    """Segments of each word that leads to a pose, in radii and radians; signs are gears."""
    s, c = math.sin(phi), math.cos(phi)
    # C S C of one side (8.1), of both sides (8.2)
    u, t = _polar(x - s, y - 1 + c)
    yield t, u, _mod(phi - t)
    u1, t1 = _polar(x + s, y - 1 - c)
    if u1 * u1 >= 4.0:
        u = math.sqrt(u1 * u1 - 4.0)
        t = _mod(t1 + math.atan2(2.0, u))
        yield t, u, _mod(t - phi)
    # C | C | C (8.3) and C | C C (8.4)
    xi, eta = x - s, y - 1 + c
    u1, theta = _polar(xi, eta)
    if u1 <= 4.0:
        u = -2.0 * math.asin(0.25 * u1)
        t = _mod(theta + 0.5 * u + math.pi)
        yield t, u, _mod(phi - t + u)
    # C C | C C (8.7) and C | C C | C (8.8)
    xi, eta = x + s, y - 1 - c
    rho = 0.25 * (2.0 + math.hypot(xi, eta))
    if rho <= 1.0:
        u = math.acos(rho)
        yield _four(u, -u, xi, eta, phi)
    rho = (20.0 - xi * xi - eta * eta) / 16.0
    if 0.0 <= rho <= 1.0:
        u = -math.acos(rho)
        if u >= -0.5 * math.pi:
            yield _four(u, u, xi, eta, phi)
    # C | C[π/2] S C (8.9, 8.10)
    rho, theta = _polar(x - s, y - 1 + c)
    if rho >= 2.0:
        r = math.sqrt(rho * rho - 4.0)
        u, t = 2.0 - r, _mod(theta + math.atan2(r, -2.0))
        yield t, -0.5 * math.pi, u, _mod(phi - 0.5 * math.pi - t)
    rho, theta = _polar(-eta, xi)
    if rho >= 2.0:
        t, u = theta, 2.0 - rho
        yield t, -0.5 * math.pi, u, _mod(t + 0.5 * math.pi - phi)
    # C | C[π/2] S C[π/2] | C (8.11)
    rho, theta = _polar(xi, eta)
    if rho >= 2.0:
        u = 4.0 - math.sqrt(rho * rho - 4.0)
        if u <= 0.0:
            t = _mod(math.atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta))
            yield t, -0.5 * math.pi, u, -0.5 * math.pi, _mod(t - phi)


def _four(u: float, v: float, xi: float, eta: float, phi: float) -> tuple[float, ...]:
    """Segments of a word of four arcs, the middle ones of u and v."""
    delta = _mod(u - v)
    a, b = math.sin(u) - math.sin(delta), math.cos(u) - math.cos(delta) - 1.0
    t1 = math.atan2(eta * a - xi * b, xi * a + eta * b)
    t2 = 2.0 * (math.cos(delta) - math.cos(v) - math.cos(u)) + 3.0
    tau = _mod(t1 + math.pi) if t2 < 0.0 else _mod(t1)
    return tau, u, v, _mod(tau - u + v - phi)


def shortest(x: float, y: float, phi: float, radius: float) -> float:
    """Length of the shortest way to a pose.

    Args:
        x, y: place ahead and to the left of where the car is.
        phi: how far it has turned to the left there, rad.
        radius: turning radius.
    """
    x, y = x / radius, y / radius
    best = math.inf
    # also from the end to the beginning, which has the same words in turn
    backwards = x * math.cos(phi) + y * math.sin(phi), x * math.sin(phi) - y * math.cos(phi)
    for one, other in ((x, y), backwards):
        for ahead in (1.0, -1.0):
            for side in (1.0, -1.0):
                turned = ahead * side * phi
                for word in _words(ahead * one, side * other, turned):
                    best = min(best, sum(map(abs, word)))
    return best * radius
