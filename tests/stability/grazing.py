"""Writes grazing.txt: the model's reflectance at grazing, in 60 digits, by the textbook formulas.

    pip install mpmath && python grazing.py > grazing.txt

Heights, parameters and indices are doubles, taken exactly. The light lies at azimuth 0, the view in the same plane on the
mirror's side (180), on the light's own (0), beside it (90), or along the normal (z = 1).
"""

from mpmath import acos, cos, exp, mp, mpf, pi, sqrt, tan

mp.dps = 60
DIFFUSE, WEIGHT, F0 = mpf(0.2), mpf(0.05), mpf(0.5)


def at(z, degrees):
    z = mpf(z)
    r = sqrt(1 - z * z)
    return {0: (r, mpf(0), z), 90: (mpf(0), r, z), 180: (-r, mpf(0), z)}[degrees]


def refracted(w, n):
    x, y, _ = w
    return (x / n, y / n, sqrt(1 - (x * x + y * y) / (n * n)))


def fresnel(c, n):
    inner = sqrt(1 - (1 - c * c) / (n * n))
    s = (c - n * inner) / (c + n * inner)
    p = (n * c - inner) / (n * c + inner)
    return (s * s + p * p) / 2


def half(i, o):
    h = [a + b for a, b in zip(i, o)]
    length = sqrt(sum(v * v for v in h))
    h = [v / length for v in h]
    return h, sum(a * b for a, b in zip(h, o))


def beckmann(h, alpha):
    theta = acos(h[2])
    return exp(-((tan(theta) / alpha) ** 2)) / (alpha**2 * cos(theta) ** 4)


def masking(h, d, i, o):
    return min(mpf(1), 2 * h[2] * o[2] / d, 2 * h[2] * i[2] / d) / (i[2] * o[2])


def reflectance(i, o, alpha, ior, rough):
    n, alpha, rough = mpf(ior), mpf(alpha), mpf(rough)
    passed, highlight, inner_i, inner_o = mpf(1), mpf(0), i, o
    if ior > 0:
        passed = (1 - fresnel(i[2], n)) * (1 - fresnel(o[2], n))
        inner_i, inner_o = refracted(i, n), refracted(o, n)
        if rough > 0:
            h, d = half(i, o)
            highlight = beckmann(h, rough) / pi * fresnel(d, n) / 4 * masking(h, d, i, o)
    h, d = half(inner_i, inner_o)
    lobe = beckmann(h, alpha) * (F0 + (1 - F0) * (1 - d) ** 5) / pi * masking(h, d, inner_i, inner_o)
    return passed * (DIFFUSE / pi + WEIGHT * lobe) + highlight


CASES = []
for z in (1e-1, 1e-2, 1e-4, 1e-6, 1e-8):
    CASES += [(z, z, 180, 0.1, 0, 0), (z, z / 3, 180, 0.1, 0, 0), (z, 1.0, 0, 0.5, 0, 0)]
    CASES += [(z, z, 180, 0.1, 1.5, 0.05), (z, z / 3, 180, 0.1, 1.5, 0), (z, z, 0, 0.3, 1.5, 0)]
    CASES += [(z, z, 90, 1.0, 1.5, 1.0)]
CASES += [(1e-1, 1e-1, 0, 10.0, 0, 0), (1e-1, 2e-1, 90, 3.0, 0, 0)]
CASES += [(z, z / 3, 180, 0.1, 1.0 + 1e-12, 0) for z in (1e-2, 1e-4, 1e-6, 1e-8)]

print("# Written by grazing.py. White chi, diffuse 0.2, one lobe of weight 0.05 and F0 0.5.")
print("# light's height, view's height, azimuth, lobe's roughness, index (0: no coat), coat's roughness, f in 1/sr")
for z_i, z_o, degrees, alpha, ior, rough in CASES:
    f = reflectance(at(z_i, 0), at(z_o, degrees), alpha, ior, rough)
    print(*(repr(v) for v in (z_i, z_o, degrees, alpha, ior, rough)), mp.nstr(f, 20))
