#!/usr/bin/env python3
"""Writes the digits of the families' tests: low-pass prototypes and band-passes by scipy.signal and by mpmath in
verify/src/analog/families/reference.txt, and numbers of prototypes by mpmath to 50 digits in digits.txt beside it.

Run from the repository root: python3 tools/analog_reference.py
Made with scipy 1.17.1 and mpmath 1.4.1.

One line a filter: source family order ripple_db attenuation_db gain, then `z re im` and `p re im` for
the roots of the closed upper half plane. A band-pass has `e low high` before them, its edges in Hz. scipy designs elliptic filters iteratively; the mpmath lines are
the closed formulas at 60 digits.

One line of digits.txt: family order ripple_db attenuation_db gain, the products of 1/2 minus each zero and of 1/2
minus each pole, and real and imaginary part of the pole with the largest imaginary part, by formulas at 110 digits.
"""

import mpmath as mp
import numpy as np
import scipy.signal as ss

mp.mp.dps = 60
OUT = "verify/src/analog/families/reference.txt"
DIGITS_OUT = "verify/src/analog/families/digits.txt"
DIGITS = 50


def upper(roots):
    roots = np.array([complex(r) for r in np.atleast_1d(roots)])
    noise = 1e-12 * np.abs(roots)
    upper_half = [(float(r.real), float(r.imag) if r.imag > e else 0.0) for r, e in zip(roots, noise) if r.imag >= -e]
    return sorted(upper_half, key=lambda r: r[1])


def line(source, family, order, ripple, attenuation, zeros, poles, gain, edges=None):
    roots = [] if edges is None else [f"e {edges[0]!r} {edges[1]!r}"]
    roots += [f"z {re!r} {im!r}" for re, im in upper(zeros)] + [f"p {re!r} {im!r}" for re, im in upper(poles)]
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
    if n == 1:
        pole = 1 / mp.sqrt(mp.mpf(10) ** (mp.mpf(ripple) / 10) - 1)
        return [], [-pole], pole
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


BANDS = [(0.1, 0.4), (0.2, 0.25), (0.2, 0.202), (1e-3, 10.0), (0.2, 0.2 + 1e-6)]
MEMBERS = [(family, n) for family in ("butterworth", "chebyshev1", "chebyshev2", "elliptic", "bessel") for n in (1, 2, 3, 6, 7)]
RIPPLE, ATTENUATION = 0.5, 60.0


def scipy_band_lines():
    designs = {
        "butterworth": lambda n, w: ss.butter(n, w, "bandpass", True, "zpk"),
        "chebyshev1": lambda n, w: ss.cheby1(n, RIPPLE, w, "bandpass", True, "zpk"),
        "chebyshev2": lambda n, w: ss.cheby2(n, ATTENUATION, w, "bandpass", True, "zpk"),
        "elliptic": lambda n, w: ss.ellip(n, RIPPLE, ATTENUATION, w, "bandpass", True, "zpk"),
        "bessel": lambda n, w: ss.bessel(n, w, "bandpass", True, "zpk", "phase"),
    }
    for family, n in MEMBERS:
        for edges in BANDS:
            filter = designs[family](n, 2 * np.pi * np.array(edges))
            yield line("scipy", family, n, *ripples(family), *filter, edges)


def ripples(family):
    return (RIPPLE if family in ("chebyshev1", "elliptic") else 0.0,
            ATTENUATION if family in ("chebyshev2", "elliptic") else 0.0)


def prototype(family, n, ripple=RIPPLE, attenuation=ATTENUATION):
    if family == "bessel":
        return bessel(n)
    if family == "elliptic":
        return elliptic(n, ripple, attenuation)
    angles = [mp.pi * (2 * i - n + 1) / (2 * n) for i in range(n)]
    if family == "butterworth":
        return [], [-mp.exp(mp.j * a) for a in angles], mp.mpf(1)
    db = ripple if family == "chebyshev1" else attenuation
    eps = mp.sqrt(mp.mpf(10) ** (mp.mpf(db) / 10) - 1)
    mu = mp.asinh(1 / eps if family == "chebyshev1" else eps) / n
    poles = [-mp.sinh(mu + mp.j * a) for a in angles]
    if family == "chebyshev1":
        gain = mp.re(mp.fprod(-p for p in poles))
        return [], poles, gain if n % 2 else gain / mp.sqrt(1 + eps * eps)
    zeros = [mp.mpc(0, 1 / mp.sin(a)) for a in angles if abs(a) > 1e-9]
    poles = [1 / p for p in poles]
    return zeros, poles, mp.re(mp.fprod(-p for p in poles) / mp.fprod(-z for z in zeros))


def band_pass(zeros, poles, gain, edges):
    w1, w2 = (2 * mp.pi * mp.mpf(f) for f in edges)
    width = w2 - w1
    moved = lambda roots: [r * width / 2 + sign * mp.sqrt((r * width / 2) ** 2 - w1 * w2) for r in roots for sign in (1, -1)]
    excess = len(poles) - len(zeros)
    return moved(zeros) + [mp.mpf(0)] * excess, moved(poles), gain * width ** excess


def mpmath_band_lines():
    for family, n in MEMBERS:
        for edges in BANDS:
            yield line("mpmath", family, n, *ripples(family), *band_pass(*prototype(family, n), edges), edges)


def mpmath_lines():
    for n in range(1, 33):
        yield line("mpmath", "bessel", n, 0.0, 0.0, *bessel(n))
    for n in (2, 3, 4, 5, 6, 7, 8, 9, 12, 20):
        for ripple, attenuation in ((0.5, 60.0), (3.0, 20.0), (0.01, 100.0), (1e-4, 3.0)):
            yield line("mpmath", "elliptic", n, ripple, attenuation, *elliptic(n, ripple, attenuation))


def digits_members():
    for n in range(1, 33):
        yield "butterworth", n, 0.0, 0.0
        yield "bessel", n, 0.0, 0.0
        yield "chebyshev1", n, 0.5, 0.0
        yield "chebyshev2", n, 0.0, 60.0
        yield "elliptic", n, 0.5, 60.0
    for n in (1, 2, 3, 4, 7, 32):
        for db in (1e-6, 0.01, 3.0103, 123.456, 300.0):
            yield "chebyshev1", n, db, 0.0
            yield "chebyshev2", n, 0.0, db
        for dbs in ((1e-6, 300.0), (1e-6, 0.5), (3.0, 300.0), (150.0, 300.0), (0.1, 20.0)):
            yield "elliptic", n, *dbs
    # Transition bands from a hundredth of the cutoff to a millionth.
    for n, *dbs in ((2, 3.0, 3.5), (3, 1.0, 1.1), (4, 3.0, 4.0), (2, 100.0, 100.001), (5, 0.5, 3.0), (3, 1e-6, 2e-6)):
        yield "elliptic", n, *dbs


def digits_lines():
    mp.mp.dps = 110
    for family, n, ripple, attenuation in digits_members():
        zeros, poles, gain = prototype(family, n, ripple, attenuation)
        at_half = [mp.re(mp.fprod(mp.mpf(0.5) - r for r in roots)) for roots in (zeros, poles)]
        upper = max(poles, key=lambda p: mp.im(p))
        numbers = [gain, *at_half, mp.re(upper), mp.im(upper) if n > 1 else mp.mpf(0)]
        yield " ".join([family, str(n), repr(ripple), repr(attenuation)] + [mp.nstr(mp.mpf(x), DIGITS, min_fixed=1, max_fixed=0) for x in numbers])


with open(DIGITS_OUT, "w") as out:
    for text in digits_lines():
        out.write(text + "\n")
mp.mp.dps = 60
with open(OUT, "w") as out:
    for text in [*scipy_lines(), *mpmath_lines(), *scipy_band_lines(), *mpmath_band_lines()]:
        out.write(text + "\n")
