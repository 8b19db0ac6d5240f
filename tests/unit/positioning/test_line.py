"""The closed form against the digest's golden vector and printed tables, and against a general least-squares solver."""

from itertools import combinations

import numpy as np
import pytest

from integrity.gnss.observations import Floats
from train_client.positioning.line import Along, Near, Sums, along, clocks_m, sums_of, time_dilution

# Section 2 of the digest, "Golden vector": no clocks of satellites, no atmosphere.
BEGIN = np.array((-3940790.0063, 3370513.5261, 3701269.2900))
END = np.array((-3940796.8296, 3370496.5705, 3701277.4109))
SATELLITES = np.array(
    [
        (-17892789.991, -6572353.9528, 18495562.4369),
        (-5067664.8583, 25876263.4825, 3189257.1343),
        (-20783439.8337, 13167492.5409, 10004967.2096),
        (-10421694.331, 2013757.0364, 24346799.9924),
    ]
)
RANGES_M = np.array([22636177.6693, 22539916.1607, 20479218.7895, 21681493.9789])

# Fitted cosines (section 1.6) and printed PDOPs of three satellites (section 2, T2 and T11), in the order of `combinations`.
PRN = (3, 6, 16, 21, 23, 31)
RUN_A = (0.494, 0.235, -0.008, -0.911, 0.727, -0.537)
RUN_B = (0.498, 0.264, 0.156, -0.986, 0.624, -0.555)
T2: tuple[float, ...] = (2.821, 0.942, 2.867, 1.325, 0.988, 1.907, 1.370, 0.792, 0.971, 1.048)
T2 += (1.170, 1.911, 1.802, 0.834, 1.207, 1.105, 0.851, 1.605, 1.103, 0.819)
T11: tuple[float, ...] = (4.017, 0.889, 3.869, 1.284, 0.913, 2.939, 1.328, 0.792, 0.931, 1.092)
T11 += (1.019, 2.888, 1.591, 0.836, 1.112, 1.165, 0.850, 1.226, 1.176, 0.843)


def near_of(y: Floats, u: Floats, w: Floats | None = None, system_of: tuple[int, ...] = ()) -> Near:
    """One point at the origin, axes not turned; y (S,), u (S, 3)."""
    systems = np.array(system_of or (0,) * len(y))
    sigma = np.ones(len(y)) if w is None else 1.0 / np.sqrt(w)
    used = np.ones(len(y), dtype=np.bool_)
    sums = sums_of(y[None, None], u.T[:, None, None], sigma, used, systems, int(systems.max()) + 1)
    return Near(np.zeros((1, 3)), np.eye(3)[None], sums)


def golden(fault_m: float) -> tuple[Near, Along, Floats]:
    los = SATELLITES - BEGIN
    rho = np.sqrt((los * los).sum(axis=1))
    e = (END - BEGIN) / np.sqrt(((END - BEGIN) ** 2).sum())
    near = near_of(RANGES_M - rho + np.array([fault_m, 0.0, 0.0, 0.0]), los / rho[:, None])
    return near, along(near, np.zeros((1, 3)), e[None]), e


def tpdop_of(cosines: tuple[float, ...]) -> float:
    u = np.array([(-a, 0.0, 0.0) for a in cosines])
    return float(along(near_of(np.zeros(len(cosines)), u), np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]])).tpdop[0])


def test_golden_distance_is_right_to_a_millimetre() -> None:
    assert golden(0.0)[1].d_m[0] == pytest.approx(7.25, abs=1e-3)


def test_golden_clock_is_right_to_a_millimetre() -> None:
    near, found, e = golden(0.0)
    assert clocks_m(near, found.d_m[:, None] * e)[0, 0] == pytest.approx(150.0, abs=1e-3)


def test_golden_dilution() -> None:
    assert golden(0.0)[1].tpdop[0] == pytest.approx(0.7809, abs=1e-4)


def test_golden_fault_moves_the_distance() -> None:
    assert golden(10.0)[1].d_m[0] == pytest.approx(2.919, abs=1e-3)


def test_golden_fault_shows_in_the_squares() -> None:
    assert golden(10.0)[1].sse[0] == pytest.approx(44.24, abs=5e-3)


@pytest.mark.parametrize(("cosines", "printed", "tolerance"), [(RUN_A, T2, 0.03), (RUN_B, T11, 0.013)])
def test_printed_dilutions_follow_from_the_cosines(cosines: tuple[float, ...], printed: tuple[float, ...], tolerance: float) -> None:
    of = dict(zip(PRN, cosines, strict=True))
    ours = [tpdop_of(tuple(of[prn] for prn in three)) for three in combinations(PRN, 3)]
    assert ours == pytest.approx(printed, rel=tolerance)


def random_sky(seed: int, n: int) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((n, 3))
    return rng.normal(0.0, 3.0, n) + 1e5, u / np.sqrt((u * u).sum(axis=1, keepdims=True)), rng.uniform(0.5, 4.0, n)


def test_two_constellations_as_a_general_solver_has_them() -> None:
    """Distance, clocks, squares, on a line that begins elsewhere: least squares of the whole design matrix."""
    y, u, w = random_sky(1, 11)
    system_of = (0,) * 6 + (1,) * 5
    e, begin = np.array([0.6, 0.0, 0.8]), np.array([3.0, -2.0, 1.0])
    near = near_of(y, u, w, system_of)
    found = along(near, begin[None], e[None])
    member = np.eye(2)[list(system_of)]
    H, root = np.column_stack((-u @ e, member)), np.sqrt(w)
    x, squares, *_ = np.linalg.lstsq(H * root[:, None], (y + u @ begin) * root, rcond=None)
    ours = [found.d_m[0], *clocks_m(near, begin + found.d_m[:, None] * e)[0], found.sse[0], 1.0 / found.s_aa[0]]
    assert ours == pytest.approx([*x, squares[0], np.linalg.inv((H * w[:, None]).T @ H)[0, 0]], rel=1e-9)


def test_degrees_of_freedom_count_a_distance_and_each_clock() -> None:
    y, u, w = random_sky(2, 9)
    assert near_of(y, u, w, (0,) * 5 + (1,) * 4).sums.dof[0] == 6


def sums_with(unused: tuple[int, ...], **bad: float) -> Sums:
    """Sums over twelve satellites of which some are not used, or bad: the tenth, if `bad` says in what."""
    y, u, w = random_sky(3, 12)
    sigma, used = 1.0 / np.sqrt(w), np.ones(12, dtype=np.bool_)
    used[list(unused)] = False
    y[10], sigma[10], u[10, 0] = bad.get("y", y[10]), bad.get("sigma", sigma[10]), bad.get("u", u[10, 0])
    return sums_of(y[None, None], u.T[:, None, None], sigma, used, np.array([0] * 6 + [1] * 6), 2)


@pytest.mark.parametrize(
    "bad", [{"y": np.nan}, {"y": np.inf}, {"y": -np.inf}, {"y": 1e200}, {"sigma": np.nan}, {"sigma": 0.0}, {"sigma": np.inf}]
)
def test_what_is_no_number_is_not_used(bad: dict[str, float]) -> None:
    assert [part.tobytes() for part in sums_with((), **bad)] == [part.tobytes() for part in sums_with((10,))]


def test_a_satellite_that_is_not_used_changes_no_bit() -> None:
    y, u, w = random_sky(4, 12)
    system_of, keep = np.array([0] * 6 + [1] * 6), np.array([True] * 3 + [False] * 2 + [True] * 7)
    args = y[None, None], u.T[:, None, None], 1.0 / np.sqrt(w)
    masked = sums_of(*args, keep, system_of, 2)
    absent = sums_of(y[None, None, keep], u.T[:, None, None, keep], args[2][keep], keep[keep], system_of[keep], 2)
    assert [part.tobytes() for part in masked] == [part.tobytes() for part in absent]


def test_the_order_of_satellites_is_rounding_only() -> None:
    y, u, w = random_sky(5, 12)
    order = np.random.default_rng(6).permutation(12)
    begin, e = np.zeros((1, 3)), np.array([[0.0, 0.6, 0.8]])
    one, other = (along(near_of(y[k], u[k], w[k]), begin, e) for k in (np.arange(12), order))
    assert np.concatenate(one) == pytest.approx(np.concatenate(other), rel=1e-9)


def test_dilutions_are_those_of_the_matrix() -> None:
    """C = (H'H)^-1 with H = [a, 1], by numpy; equal weights, one constellation."""
    cosines = np.array([0.494, 0.235, -0.911, 0.727])
    near = near_of(np.zeros(4), np.array([(-a, 0.0, 0.0) for a in cosines]))
    line = np.array([[1.0, 0.0, 0.0]])
    found = along(near, np.zeros((1, 3)), line)
    H = np.stack((cosines, np.ones(4)), axis=1)
    C = np.linalg.inv(H.T @ H)
    assert (float(found.tpdop[0]), float(time_dilution(near, line, found)[0, 0])) == pytest.approx(tuple(np.sqrt(np.diag(C))), rel=1e-12)
