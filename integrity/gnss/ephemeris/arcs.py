"""Orbits of Kepler elements by the quarter of an hour, as polynomials of time.

A set serves for hours and is asked for at every epoch: on each arc its positions and clock are computed at a few times, Chebyshev's nodes,
and the polynomial through them gives the rest, with the derivatives. Arcs begin at fixed GPS times, so that a state depends on its set and
its time alone, however a stream is cut into blocks.

The polynomial leaves the orbit by 0.01 mm and 1e-6 m/s at most for eccentricities up to 0.08, by 0.1 mm and 1e-5 m/s for 0.2; the clock by
1e-17 s. Source of the nodes: Press et al., Numerical Recipes, 3rd edition, 5.8.
"""

from math import cos, pi

import numpy as np

from integrity.gnss.ephemeris.kepler import Elements, evaluate
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats, Ints, slices

HALF_S = 450
HALF_NS = HALF_S * NS_PER_S
NODES = 7


def _node(j: int) -> float:
    return cos((2 * j + 1) * pi / (2 * NODES))


def _powers(j: int) -> list[float]:
    """Coefficients, the constant first, of the polynomial that is one at node j and zero at the others."""
    c = [1.0]
    for node in (_node(m) for m in range(NODES) if m != j):
        c = [(low - node * high) / (_node(j) - node) for low, high in zip([0.0, *c], [*c, 0.0], strict=True)]
    return c


_NODE_S = HALF_S * np.array([_node(j) for j in range(NODES)])
_POWERS = np.array([_powers(j) for j in range(NODES)])


def kepler_states(of: Elements, index: Ints, t_ns: Ints) -> Floats:
    """Position, velocity, acceleration (x, y, z each), clock and its drift, (11, E, S), of the sets `index` (E, S) at GPS times (E,)."""
    arcs, arc = np.unique(t_ns // (2 * HALF_NS), return_inverse=True)
    middle_ns = (2 * arcs + 1) * HALF_NS
    of_arc, of_set, piece = _pieces(arc, index)
    coefficients = _coefficients(of, of_set, middle_ns[of_arc])
    tau = (t_ns - middle_ns[arc]) / HALF_NS
    out = np.empty((11, *index.shape))
    for few in slices(*index.shape):
        _put(out[:, few], coefficients, piece[few], np.repeat(tau[few], index.shape[1]).reshape(piece[few].shape))
    return out


def _pieces(arc: Ints, index: Ints) -> tuple[Ints, Ints, Ints]:
    """The pieces of orbits that are needed: of each its arc and its set, (n,) both; and which piece serves where, (E, S)."""
    sets = np.flatnonzero(np.bincount(index.reshape(-1) + 1)) - 1  # -1 among them: no set is a set like others, which gives NaN
    place = np.zeros(int(index.max(initial=-1)) + 2, dtype=np.int64)
    place[sets] = np.arange(len(sets))
    place = place[index]
    serving = np.zeros((int(arc.max(initial=-1)) + 1, len(sets)), dtype=np.bool_)
    serving[arc[:, None], place] = True
    piece = np.cumsum(serving).reshape(serving.shape) - 1
    of_arc, of_set = np.nonzero(serving)
    return of_arc, sets[of_set], piece[arc[:, None], place]


def _coefficients(of: Elements, which: Ints, middle_ns: Ints) -> Floats:
    """Of x, y, z and the clock on n pieces, by powers of tau, which goes from -1 to 1 around the `middle_ns` (n,): (NODES, 4, n)."""
    at_nodes = np.array(evaluate(of.parameters(which, middle_ns), _NODE_S[:, None], of.tilted[which]))
    c: Floats = sum(powers[:, None, None] * at_nodes[:, j] for j, powers in enumerate(_POWERS))
    return c


def _put(out: Floats, coefficients: Floats, which: Ints, tau: Floats) -> None:
    """States (11, e, S) by Horner's scheme: p, its derivative v and half the second one, a."""
    v = coefficients[-1].take(which, axis=1)
    p = v * tau + coefficients[-2].take(which, axis=1)
    a = np.zeros_like(p[:3])
    for c in coefficients[-3::-1]:
        a *= tau
        a += v[:3]
        v *= tau
        v += p
        p *= tau
        p += c.take(which, axis=1)
    out[0:3], out[9] = p[:3], p[3]
    v /= HALF_S
    out[3:6], out[10] = v[:3], v[3]
    a *= 2.0 / HALF_S**2
    out[6:9] = a
