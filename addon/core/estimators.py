"""Form factors between surfaces by a named method: analytic, hemicube, Monte Carlo; one interface, errors stated."""

from __future__ import annotations

import numpy as np

from .analytic import Surface, element_form_factor, exchange_matrix, surface_exchange
from .bodies import PANEL_ERROR, Body, body_exchanges
from .sampled import SampledEstimator
from .transport import Estimate
from .workers import Workers


class AnalyticEstimator:
    """Float64, deterministic; the error it states is what the integration allows itself."""

    name = "analytic"
    setting = "contour integral to 1e-9, hidden parts to 1e-6 of the pair"

    def factor(self, emitter: Surface, target: Surface, blockers=()) -> Estimate:
        """F from emitter to target among blockers."""
        return _certain(surface_exchange(emitter, target, blockers) / emitter.area)

    def element(self, point, normal, target: Surface, blockers=()) -> Estimate:
        """F from an element (3,), (3,) to target among blockers."""
        return _certain(element_form_factor(point, normal, target, blockers))

    def matrix(self, surfaces, blockers=()) -> Estimate:
        """F of all pairs, float64 (N, N)."""
        areas = np.array([s.area for s in surfaces])
        return _certain(exchange_matrix(surfaces, blockers) / areas[:, None])

    def body_matrix(self, bodies: list[Body]) -> Estimate:
        """F of all pairs of bodies of revolution between which nothing stands, float64 (N, N)."""
        areas = np.array([body.area for body in bodies])
        return _certain(body_exchanges(bodies) / areas[:, None], PANEL_ERROR)


def _certain(value, relative=1e-6):
    value = np.asarray(value, np.float64)
    return Estimate(value, np.zeros_like(value), relative * np.abs(value))


def make_estimator(method: str, workers: Workers, seed: int = 0):
    """The estimator that ``method`` names."""
    return AnalyticEstimator() if method == "analytic" else SampledEstimator(method, workers, seed=seed)
