"""Graphs of values: of receivers that are no mesh's, alone or in a row, and of a scene's vertices."""

import numpy as np

from addon.core.vertex_graph import VertexGraph
from addon.core.vertices import vertex_receivers
from tests.scenes import kernel_of


def row_graph(count, reach=0, owners=None):
    """Each of ``count`` receivers a value (or as ``owners`` say), its neighbours those up to ``reach`` beside it."""
    owners = np.arange(count) if owners is None else owners
    sizes = np.bincount(owners)
    values = len(sizes)
    steps = np.setdiff1d(np.arange(-reach, reach + 1), [0])
    around = np.arange(values)[:, None] + steps
    is_there = (around >= 0) & (around < values)
    return VertexGraph(
        triangles=np.zeros(0, np.int32),
        owners=owners,
        shares=1 / sizes[owners],
        first_edges=np.append(0, np.cumsum(is_there.sum(axis=1))).astype(np.int32),
        neighbours=around[is_there].astype(np.int32),
        nearness=np.ones(is_there.sum(), np.float32),
        shown=(count / max(values, 1) / sizes[owners]).astype(np.float32),
    )


def vertices_of(scene, angle=30.0):
    """The receivers beside a scene's vertices, and their graph."""
    with kernel_of(scene) as kernel:
        return vertex_receivers(scene, kernel, angle)
