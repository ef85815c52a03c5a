"""More triangles on the same surface: the longest edge first, halved."""

import numpy as np

from proxcgal.core.typing import Array, Ints
from proxcgal.models.mesh.triangles import half_edges

# Edges at least this share of the longest go in the same round.
_SHARE = 0.7


def subdivide(vertices: Array, triangles: Ints, count: int) -> tuple[Array, Ints]:
    """Halve edges until there are `count` vertices; no point of the surface moves.

    An edge goes when it is the longest of each of its faces, and every face on it is cut, so that
    no gap opens.

    Args:
        vertices: (v, 3) [m], welded.
        triangles: (f, 3).
        count: at least v.

    Returns:
        vertices (count, 3) and triangles; the first v vertices are those given.
    """
    v, f = vertices, triangles.astype(np.int64)
    while len(v) < count:
        sides = np.sort(half_edges(f), axis=1)
        (
            key,
            edge_of,
        ) = np.unique(sides[:, 0] * len(v) + sides[:, 1], return_inverse=True)
        edge_of = edge_of.reshape(3, -1).T  # (f, 3)
        a, b = key // len(v), key % len(v)
        length = np.linalg.norm(v[a] - v[b], axis=1)
        rank = np.empty(len(key), dtype=np.int64)
        order = np.argsort(-length, kind="stable")
        rank[order] = np.arange(len(key))
        # The face's longest side, and edges that are that for all their faces.
        longest = np.take_along_axis(edge_of, rank[edge_of].argmin(axis=1)[:, None], axis=1)[:, 0]
        wanted = np.bincount(longest, minlength=len(key))
        terminal = (wanted == np.bincount(edge_of.ravel(), minlength=len(key))) & (wanted > 0)
        chosen = order[terminal[order] & (length[order] >= _SHARE * length[order[0]])]
        chosen = chosen[: count - len(v)]
        middle = np.full(len(key), -1)
        middle[chosen] = len(v) + np.arange(len(chosen))
        v = np.concatenate([v, (v[a[chosen]] + v[b[chosen]]) / 2])
        cut = middle[longest] >= 0
        side = (edge_of[cut] == longest[cut, None]).argmax(axis=1)
        old = f[cut]
        rows = np.arange(len(old))
        corner = [old[rows, (side + k) % 3] for k in range(3)]
        new = middle[longest[cut]]
        f = np.concatenate([
            f[~cut],
            np.stack([corner[0], new, corner[2]], axis=1),
            np.stack([new, corner[1], corner[2]], axis=1),
        ])  # fmt: skip
    return v, f.astype(np.int32)
