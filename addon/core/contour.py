"""The double contour integral of form factors between polygons that see each other whole.

A_1 F_12 = 1 / (2 pi) contour_1 contour_2 ln r dr_1 . dr_2 (Moon 1936; Sparrow 1963). The inner integral is closed;
parallel edges are closed altogether; of skew edges the outer integral is by Gauss on panels that shrink towards the
places where the integrand is singular, which are known: the feet of the other edge's ends and the point
where the two lines are nearest.
"""

from __future__ import annotations

import numpy as np

from .quadrature import gauss

NODES = 14
LEAST_ELLIPSE = 3.5  # Bernstein ellipse free of singularities: error about 3.5^(-2 * 14) = 6e-16 of the panel
SMALLEST_PANEL = 2.0**-30  # of the edge: x ln x integrates to 1e-18 there, whatever the rule
PARALLEL = 1e-14  # sine of the angle between edges below which they are taken as parallel


def contour_exchange(first, second):
    """A_1 F_12 [m^2] of two polygons (K, 3), (M, 3) that see each other whole, and its rounding error [m^2], about.

    Both must lie in front of each other's plane. Touching is allowed.
    """
    values, sizes = contour_exchanges(first[None], second[None])
    return float(values[0]), float(sizes[0])


def contour_exchanges(first, second):
    """The same for many pairs at once: corners (N, K, 3), (N, M, 3); returns (N,), (N,)."""
    count = len(first)
    a, b = _edges(first), _edges(second)
    index = np.stack(np.meshgrid(np.arange(count), np.arange(a[0].shape[1]), np.arange(b[0].shape[1]), indexing="ij"))
    pair, i, j = index.reshape(3, -1)
    p, u, m = (part[pair, i] for part in a)
    q, v, n = (part[pair, j] for part in b)
    # a constant added to ln r adds nothing around a contour: lengths in units of the distance keep the terms small
    centres = first.mean(axis=1) - second.mean(axis=1)
    reach = np.abs(first - first.mean(axis=1, keepdims=True)).max(axis=(1, 2))
    scale = np.maximum(np.linalg.norm(centres, axis=1), reach)[pair]
    cosine = (u * v).sum(axis=1)
    used = np.flatnonzero((cosine != 0) & (m > 0) & (n > 0))
    sine = np.linalg.norm(np.cross(u, v), axis=1)
    terms, sizes = np.zeros(len(pair)), np.zeros(len(pair))
    is_parallel = sine[used] < PARALLEL
    flat, skew = used[is_parallel], used[~is_parallel]
    terms[flat], sizes[flat] = _parallel(*(x[flat] for x in (p, u, m, q, cosine, n, scale)))
    terms[skew] = cosine[skew] * _skew(*(x[skew] for x in (p, u, m, q, v, n, scale, sine, cosine)))
    sizes[skew] = np.abs(terms[skew])
    terms, sizes = (part.reshape(count, -1).sum(axis=1) / (2 * np.pi) for part in (terms, sizes))
    return terms, np.finfo(float).eps * sizes


def _edges(corners):
    along = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(along, axis=2)
    return corners, along / np.where(lengths > 0, lengths, 1.0)[..., None], lengths


def _parallel(p, u, m, q, cosine, n, scale):
    """Both integrals closed: differences of G, G'' = ln(sqrt(t^2 + h^2) / scale), at the four pairs of ends.

    Returns the term of each pair, and the size of what was subtracted to get it.
    """
    sign = np.sign(cosine)
    start = ((q - p) * u).sum(axis=1)
    height = np.linalg.norm(np.cross(q - p, u), axis=1)
    stop = start + sign * n
    # sign: the second edge runs against the first
    low, high = np.minimum(start, stop), np.maximum(start, stop)
    inner = _second_primitive(np.stack([high - m, low, high, low - m]), height, scale)
    return sign * ((inner[2] + inner[3]) - (inner[0] + inner[1])), np.abs(inner).sum(axis=0)


def _second_primitive(t, height, scale):
    """G(t) with G'' = ln(sqrt(t^2 + h^2) / scale), up to what cancels around contours: constants, terms linear in t."""
    squared = t * t + height * height
    logarithm = 0.5 * np.log(np.where(squared > 0, squared, 1.0) / scale**2)
    angle = np.arctan2(t, height)
    return 0.5 * (t * t - height * height) * logarithm + height * t * angle - 0.75 * t * t


def _skew(p, u, m, q, v, n, scale, sine, cosine):
    """Outer integral over the first edge of the inner integral over the second, (N,)."""
    pair, low, high = _panels(p, u, m, q, v, n, sine, cosine)
    nodes, weights = gauss(NODES)
    out = np.zeros(len(p))
    for part in np.array_split(np.arange(len(pair)), max(1, len(pair) // 20000)):
        k = pair[part]
        at = low[part, None] + (high - low)[part, None] * nodes
        to = q[k, None] - (p[k, None] + at[..., None] * u[k, None])
        inner = _inner(to, v[k, None], n[k, None], scale[k, None])
        out += np.bincount(k, (inner @ weights) * (high - low)[part], minlength=len(p))
    return out


def _inner(to, v, n, scale):
    """Integral of ln(r / scale) along an edge: [t ln r - t + h atan(t / h)]."""
    start = (to * v).sum(axis=-1)
    stop = start + n
    height = np.linalg.norm(np.cross(to, v), axis=-1)
    near, far = start**2 + height**2, stop**2 + height**2
    logarithms = 0.5 * (
        stop * np.log(np.where(far > 0, far, 1.0) / scale**2) - start * np.log(np.where(near > 0, near, 1.0) / scale**2)
    )
    return logarithms - n + height * np.arctan2(height * n, height**2 + start * stop)


def _panels(p, u, m, q, v, n, sine, cosine):
    """Panels of the first edges, halved until no singularity is near: pair index, start, stop along the edge."""
    to = q - p
    along_first, along_second = (to * u).sum(axis=1), (to * v).sum(axis=1)
    nearest = (along_first - cosine * along_second) / sine**2
    normal = np.cross(u, v) / sine[:, None]
    end = to + n[:, None] * v
    places = np.stack([along_first, (end * u).sum(axis=1), nearest], axis=1)
    offsets = np.stack(
        [
            np.linalg.norm(np.cross(to, u), axis=1),
            np.linalg.norm(np.cross(end, u), axis=1),
            np.abs((to * normal).sum(axis=1)) / sine,
        ],
        axis=1,
    )
    singular = places + 1j * offsets
    pair, low, high = np.arange(len(p)), np.zeros(len(p)), m.astype(float)
    done = []
    while len(pair):
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        z = (singular[pair] - middle[:, None]) / half[:, None]
        root = np.sqrt(z * z - 1)
        ellipse = np.maximum(np.abs(z + root), np.abs(z - root)).min(axis=1)
        is_done = (ellipse > LEAST_ELLIPSE) | (half < SMALLEST_PANEL * m[pair])
        done.append((pair[is_done], low[is_done], high[is_done]))
        rest = ~is_done
        pair = np.concatenate([pair[rest], pair[rest]])
        low, high = np.concatenate([low[rest], middle[rest]]), np.concatenate([middle[rest], high[rest]])
    return tuple(np.concatenate(parts) for parts in zip(*done)) if done else (pair, low, high)
