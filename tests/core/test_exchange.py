"""Exchange from noisy rows: symmetric to the bit, closed, reciprocal, and nearer to the truth than the rows were."""

import numpy as np
import pytest

from addon.core.exchange import exchange_of
from tests.reference.radiosity import by_series, cube


def noisy_rows(rng, rays, sides=12, dtype=np.float32):
    """Rows of a sphere's zones of many sizes as so many rays find them: multinomial. Areas, exact F, noisy F."""
    areas = rng.uniform(0.2, 3.0, sides)
    exact = np.tile(areas / areas.sum(), (sides, 1))
    return areas, exact, np.stack([rng.multinomial(rays, row) / rays for row in exact]).astype(dtype)


@pytest.mark.parametrize("sides", [12, 700])  # one block of rows, and two
def test_pairs_are_equal_to_the_bit(sides):
    areas, _, rows = noisy_rows(np.random.default_rng(0), 1 << 12, sides)
    exchange = exchange_of(rows, areas)
    assert (exchange.pairs == exchange.pairs.T).all()
    assert (exchange.pairs >= 0).all()


def test_rows_are_closed_again_although_reciprocal_averages_are_not():
    areas, _, rows = noisy_rows(np.random.default_rng(1), 1 << 10)
    averaged = areas * (rows + rows.T.astype(float)) / (areas[:, None] + areas)
    assert np.abs(averaged.sum(axis=1) - 1).max() > 1e-3  # what at rho = 0.999 would double the light or diverge
    exchange = exchange_of(rows, areas)
    closed = exchange.form_factors(areas)
    assert closed.sum(axis=1) == pytest.approx(np.ones(len(areas)), abs=1e-14)  # sums of 12 terms
    assert (areas[:, None] * closed) == pytest.approx((areas[:, None] * closed).T, abs=1e-14)
    # scaling has done it, not the sides' own exchange, which float32 rounding and 1e-6 of the scaling are left to
    assert np.abs(exchange.own).max() < 1e-5


def test_the_exchange_is_nearer_to_the_truth_than_the_rows():
    raw, repaired = [], []
    for seed in range(20):
        areas, exact, rows = noisy_rows(np.random.default_rng(seed), 1 << 10)
        raw.append(np.mean((rows - exact) ** 2))
        repaired.append(np.mean((exchange_of(rows, areas).form_factors(areas) - exact) ** 2))
    # two estimates of a pair averaged: half the variance, the closure takes off a little more
    assert 0.3 < np.mean(repaired) / np.mean(raw) < 0.65


def test_an_exact_matrix_stays_as_it_is():
    matrix, areas = cube()
    exchange = exchange_of(matrix.copy(), areas)
    assert exchange.form_factors(areas) == pytest.approx(matrix, abs=1e-15)
    assert (exchange.escapes == 0).all()


def test_what_rays_saw_escape_still_escapes():
    rng = np.random.default_rng(2)
    areas, _, rows = noisy_rows(rng, 1 << 12)
    rows[:4] *= np.float32(0.75)  # exact in float32
    exchange = exchange_of(rows, areas)
    assert exchange.escapes == pytest.approx(np.where(np.arange(12) < 4, 0.25 * areas, 0.0), abs=1e-6)
    assert exchange.form_factors(areas).sum(axis=1) == pytest.approx(1 - exchange.escapes / areas, abs=1e-12)


def test_rows_known_to_be_closed_are_closed():
    matrix, areas = cube()
    lossy = matrix * np.array([1.0, 0.99, 1.01, 1.0, 1.0, 0.995])[:, None]  # as a quadrature of rows leaves them
    open_, closed = exchange_of(lossy.copy(), areas), exchange_of(lossy.copy(), areas, is_closed=True)
    assert open_.escapes.max() == pytest.approx(0.01)
    assert (closed.escapes == 0).all()
    furnace = by_series(closed.form_factors(areas), np.full(6, 0.9999), np.ones(6))
    assert furnace == pytest.approx(np.full(6, 1e4), rel=1e-9)  # 1e4 times the rounding of sums of 6


def test_the_system_stays_positive_however_bad_the_rows_are():
    rng = np.random.default_rng(3)
    areas, _, rows = noisy_rows(rng, 8)  # eight rays a row: many pairs see each other one way only
    pairs = exchange_of(rows, areas).form_factors(areas) * areas[:, None]
    system = np.diag(areas / 0.9999) - pairs
    # at least A (1 / rho - 1), the rest of the quadratic form being squares
    assert np.linalg.eigvalsh(system).min() >= 0.999 * areas.min() * (1 / 0.9999 - 1)


def test_what_arrives_is_the_product_with_the_form_factors():
    rng = np.random.default_rng(4)
    areas, _, rows = noisy_rows(rng, 1 << 10, 600)
    exchange = exchange_of(rows, areas)
    radiosity = rng.random((600, 3))
    # float32 pairs, summed in float64
    assert exchange.arriving(radiosity) == pytest.approx(
        areas[:, None] * (exchange.form_factors(areas) @ radiosity), rel=1e-12
    )
