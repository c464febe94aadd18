"""Smoothing by its definition, float64: a level of it (Dammertz et al. 2010, eq. 7; B3 spline taps), and outliers."""

import numpy as np

SPLINE = np.array([1, 4, 6, 4, 1]) / 16


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def smooth(grid, spacing, positions, normals, values, variances, step, stops_on_value):
    """Means of values (N, 3) over the 5 x 5 taps ``step`` texels apart of a grid (H, W), and their variance."""
    out, out_variances = np.zeros((len(values), 3)), np.zeros(len(values))
    luminances = values @ LUMINANCE
    for row, column in zip(*np.nonzero(grid >= 0)):
        here = grid[row, column]
        total = 0.0
        for i, j in np.ndindex(5, 5):
            y, x = row + step * (i - 2), column + step * (j - 2)
            if not (0 <= y < grid.shape[0] and 0 <= x < grid.shape[1]) or grid[y, x] < 0:
                continue
            there = grid[y, x]
            weight = SPLINE[i] * SPLINE[j]
            if there != here:
                reach = spacing * step * np.hypot(i - 2, j - 2)
                weight *= _same_surface(positions[here], positions[there], normals[here], normals[there], reach)
                if stops_on_value:
                    weight *= _alike(luminances[here] - luminances[there], variances[here], variances[there])
            out[here] += weight * values[there]
            out_variances[here] += weight**2 * variances[there]
            total += weight
        out[here] /= total
        out_variances[here] /= total**2
    return out, out_variances


def clamp_outliers(grid, spacing, positions, normals, values, variances):
    """Values (N, 3) scaled to lie in luminance among those of the same surface around them, if noise explains it."""
    out, luminances = values.copy(), values @ LUMINANCE
    for row, column in zip(*np.nonzero(grid >= 0)):
        here, around = grid[row, column], []
        for y, x in np.ndindex(*grid.shape):
            is_beside = max(abs(y - row), abs(x - column)) == 1
            if not is_beside or grid[y, x] < 0:
                continue
            there, reach = grid[y, x], spacing * np.hypot(y - row, x - column)
            if _same_surface(positions[here], positions[there], normals[here], normals[there], reach) > 0:
                around.append(luminances[there])
        if len(around) >= 3 and luminances[here] > 0:
            change = np.clip(luminances[here], min(around), max(around)) - luminances[here]
            most = 2 * np.sqrt(variances[here])
            out[here] *= 1 + np.clip(change, -most, most) / luminances[here]
    return out


def _falling(x):
    """About exp(-x), with an end."""
    return max(0.0, 1 - x / 8) ** 8


def _alike(difference, a, b):
    """How far values of variances a and b are the same: of their noise the greater counts for four times the other."""
    noise = min(a, 4 * b) + min(b, 4 * a)
    return _falling(difference**2 / (7 * noise)) if noise > 0 else float(difference == 0)


def _same_surface(p, q, n, m, reach):
    cosine, apart = n @ m, q - p
    if cosine < 0.9 or apart @ apart > 4 * reach**2:
        return 0.0
    return cosine**8 * _falling(8 * (apart @ n / reach) ** 2)


def smooth_graph(neighbours, nearness, values, variances, stops_on_value):
    """Means of values (V, 3) and those of their neighbours, lists of indices and of weights; and their variance."""
    out, out_variances = np.zeros((len(values), 3)), np.zeros(len(values))
    luminances = values @ LUMINANCE
    for here in range(len(values)):
        weights = {here: 1.0}
        for there, weight in zip(neighbours[here], nearness[here]):
            if stops_on_value:
                weight *= _alike(luminances[here] - luminances[there], variances[here], variances[there])
            weights[there] = weight
        total = sum(weights.values())
        out[here] = sum(weight * values[k] for k, weight in weights.items()) / total
        out_variances[here] = sum(weight**2 * variances[k] for k, weight in weights.items()) / total**2
    return out, out_variances
