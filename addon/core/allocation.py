"""Which receivers get further rays, and how many: rays go where they take most off the error that is left."""

from __future__ import annotations

import numpy as np

GROWTH = 4  # times the rays that a receiver has, that a pass adds at the most: what is known by then is not known well
WORTH = 1.25  # times the rays it has, that a receiver must be due to go on
LEAST_NOISE = 1e-6  # where replicates agree by chance, or because all of them missed the light
BINS = 16  # of measured receivers, by their stated noise
LESS = 0.7  # times what receivers are due, again and again, until it can be afforded


def measured_errors(relative, chosen, squares):
    """Relative errors (N,) that receivers of a stated noise turn out to have.

    The noise that few replicates state after smoothing is a good order and a poor measure: how far it is off is taken
    from receivers of about that noise that were measured.

    Parameters
    ----------
    relative : (N,) stated noise of each
    chosen, squares : (M,) some of them, and their squared relative errors as measured: negative ones are noise of that
    """
    relative = np.maximum(relative, np.float32(LEAST_NOISE))
    order = np.argsort(relative[chosen], kind="stable")
    bins = [part for part in np.array_split(order, BINS) if len(part)]
    stated = np.array([np.sqrt(np.mean(relative[chosen[part]] ** 2)) for part in bins])
    # what is noisier is not less wrong: where it seems so, that is chance
    found = np.sqrt(np.maximum.accumulate([max(squares[part].mean(), 0.0) for part in bins]))
    relative *= np.interp(relative, stated, found / stated)
    return relative


def rays_due(errors, taken, target, power=1.0):
    """Rays (N,) of a replicate that each receiver is due, for the RMS of all errors to be the target at least cost.

    Where the square of an error falls as 1 / rays^power, with n_i rays the mean square is sum(s_i / n_i^power) / N,
    s_i = errors^2 * taken^power, which is least for its rays where n_i is in proportion to s_i^(1 / (1 + power)): for a
    power of 1 to the noise of one ray (Neyman 1934, "optimum allocation").
    """
    errors = np.asarray(errors, np.float64)  # their squares may leave float32
    share = (errors**2 * taken**power) ** (1 / (1 + power))
    return share * (share.sum() / (len(share) * target**2)) ** (1 / power)


def next_pass(due, taken, most, cost, rays_left):
    """Receivers that the next pass is for, in order, int64 (K,), and rays of a replicate for each of all, int32 (N,).

    The power of two next to what they are due, so that neighbours share its even spread, and none above what they may
    have; fewer for all where the pass could not be afforded.

    Parameters
    ----------
    due : (N,) rays of a replicate
    taken : (N,) rays that receivers have
    most : that one may have
    cost : rays traced for one of all replicates
    """
    taken = taken.astype(due.dtype)
    allowed = np.maximum(np.minimum(most - taken, GROWTH * taken), 0)
    highest = np.floor(np.log2(np.maximum(allowed, 1)))
    due = np.minimum(due, taken + allowed)
    while True:
        wanted = np.maximum(due - taken, 0)
        powers = np.round(np.log2(np.maximum(wanted, 1)))
        further = 2 ** np.minimum(powers, highest).astype(np.int32)
        active = np.flatnonzero(wanted >= np.maximum((WORTH - 1) * taken, 1))
        if cost * further[active].sum(dtype=np.int64) <= rays_left or not len(active):
            return active, further
        due = LESS * due
