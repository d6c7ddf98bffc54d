#!/usr/bin/env python3
"""Writes src/analog/families/reference.txt: low-pass prototypes by scipy.signal and by mpmath.

Run from the repository root: python3 tools/analog_reference.py
Made with scipy 1.17.1 and mpmath 1.3.0.

One line a filter: source family order ripple_db attenuation_db gain, then `z re im` and `p re im` for
the roots of the closed upper half plane. scipy designs elliptic filters iteratively; the mpmath lines are
the closed formulas at 60 digits.
"""

import mpmath as mp
import numpy as np
import scipy.signal as ss

mp.mp.dps = 60
OUT = "src/analog/families/reference.txt"


def upper(roots):
    roots = np.array([complex(r) for r in np.atleast_1d(roots)])
    noise = 1e-12 * np.abs(roots)
    upper_half = [(float(r.real), float(r.imag) if r.imag > e else 0.0) for r, e in zip(roots, noise) if r.imag > -e]
    return sorted(upper_half, key=lambda r: r[1])


def line(source, family, order, ripple, attenuation, zeros, poles, gain):
    roots = [f"z {re!r} {im!r}" for re, im in upper(zeros)] + [f"p {re!r} {im!r}" for re, im in upper(poles)]
    return " ".join([source, family, str(order), repr(ripple), repr(attenuation), repr(float(gain))] + roots)


def scipy_lines():
    for n in range(1, 13):
        yield line("scipy", "butterworth", n, 0.0, 0.0, *ss.buttap(n))
        for ripple in (0.01, 0.5, 3.0):
            yield line("scipy", "chebyshev1", n, ripple, 0.0, *ss.cheb1ap(n, ripple))
        for attenuation in (10.0, 40.0, 100.0):
            yield line("scipy", "chebyshev2", n, 0.0, attenuation, *ss.cheb2ap(n, attenuation))
        for ripple, attenuation in ((0.5, 60.0), (3.0, 20.0), (0.01, 100.0)):
            yield line("scipy", "elliptic", n, ripple, attenuation, *ss.ellipap(n, ripple, attenuation))
    for n in range(1, 26):
        yield line("scipy", "bessel", n, 0.0, 0.0, *ss.besselap(n, norm="phase"))


def bessel(n):
    coefficients = [mp.factorial(2 * n - k) / (2 ** (n - k) * mp.factorial(k) * mp.factorial(n - k)) for k in range(n + 1)]
    roots = mp.polyroots(coefficients[::-1], maxsteps=2000, extraprec=400)
    scale = coefficients[0] ** (mp.mpf(1) / n)
    return [], [r / scale for r in roots], 1.0


def elliptic(n, ripple, attenuation):
    e1 = mp.mpf(10) ** (mp.mpf(ripple) / 10) - 1
    e2 = mp.mpf(10) ** (mp.mpf(attenuation) / 10) - 1
    m1 = e1 / e2
    q = mp.qfrom(m=m1) ** (mp.mpf(1) / n)
    m = mp.mfrom(q=q)
    big_k = mp.ellipk(m)
    # sc(r, 1 - m1) = 1/eps, hence r = F(atan(1/eps) | 1 - m1).
    r = mp.ellipf(mp.atan(1 / mp.sqrt(e1)), 1 - m1)
    v0 = big_k * r / (n * mp.ellipk(m1))
    # Poles by the Jacobi function of complex argument: p = j sn(u + j v0).
    zeros, poles = [], []
    for j in range(1 - n % 2, n, 2):
        u = j * big_k / n
        p = mp.j * mp.ellipfun("sn", u + mp.j * v0 if j else mp.j * v0, m=m)
        poles.append(mp.mpc(-abs(p.real), p.imag))
        if j:
            poles.append(mp.conj(poles[-1]))
            z = 1 / (mp.sqrt(m) * mp.ellipfun("sn", u, m=m))
            zeros += [mp.mpc(0, z), mp.mpc(0, -z)]
    gain = mp.re(mp.fprod(-p for p in poles) / mp.fprod(-z for z in zeros))
    return zeros, poles, gain if n % 2 else gain / mp.sqrt(1 + e1)


def mpmath_lines():
    for n in range(1, 33):
        yield line("mpmath", "bessel", n, 0.0, 0.0, *bessel(n))
    for n in (2, 3, 4, 5, 6, 7, 8, 9, 12, 20):
        for ripple, attenuation in ((0.5, 60.0), (3.0, 20.0), (0.01, 100.0), (1e-4, 3.0)):
            yield line("mpmath", "elliptic", n, ripple, attenuation, *elliptic(n, ripple, attenuation))


with open(OUT, "w") as out:
    for text in [*scipy_lines(), *mpmath_lines()]:
        out.write(text + "\n")
