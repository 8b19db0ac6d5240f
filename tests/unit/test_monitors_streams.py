"""The streams themselves: enough satellites, frozen receivers, lost signals, drops of C/N0."""

import numpy as np
import pytest

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats
from integrity.monitors.streams import cn0_drop_db, last_seen, lost_share, missing_satellites, repeating_receivers, second_worst

NAN = float("nan")


@pytest.mark.parametrize(("used", "missing"), [(0, 5.0), (4, 1.0), (5, 0.0), (6, 0.0)])
def test_missing_satellites(used: int, missing: float) -> None:
    assert missing_satellites((np.arange(10) < used)[None], 5).tolist() == [missing]


MOVING = np.array([[[2.0e7, 2.1e7, NAN]], [[2.0e7 + 1.0, 2.1e7 + 1.0, NAN]]])  # (E, R, S): two epochs of one receiver
NOTHING = np.full((1, 3), NAN)


@pytest.mark.parametrize(
    ("now", "before", "frozen"),
    [
        ((2.0e7, 2.1e7, NAN), (2.0e7, 2.1e7, NAN), True),
        ((2.0e7, 2.1e7, NAN), (2.0e7, 2.1e7, 2.2e7), True),
        ((2.0e7, 2.1e7, NAN), (2.0e7, np.nextafter(2.1e7, 0.0), NAN), False),
        ((2.0e7, 2.1e7, 2.2e7), (2.0e7, 2.1e7, NAN), False),
        ((2.0e7, 2.1e7, NAN), (NAN, NAN, NAN), False),
        ((NAN, NAN, NAN), (NAN, NAN, NAN), False),
        ((NAN, NAN, NAN), (2.0e7, 2.1e7, NAN), False),
    ],
    ids=["frozen", "frozen, one lost", "one moves by a bit", "one is new", "first epoch", "nothing ever", "nothing now"],
)
def test_frozen_receivers(now: tuple[float, ...], before: tuple[float, ...], frozen: bool) -> None:
    assert repeating_receivers(np.array([[now]]), np.array([before])).tolist() == [[frozen]]


def test_a_receiver_is_compared_with_the_epoch_before_in_the_block() -> None:
    ranges = np.concatenate((MOVING, MOVING[1:], MOVING[:1]))
    assert repeating_receivers(ranges, NOTHING)[:, 0].tolist() == [False, False, True, False]


def test_each_receiver_is_compared_with_itself() -> None:
    both = np.concatenate((MOVING, MOVING[[0, 0]]), axis=1)
    assert repeating_receivers(both, np.full((2, 3), NAN)).tolist() == [[False, False], [False, True]]


def test_last_seen_begins_with_what_was_known() -> None:
    seen = np.array([[[True, False]], [[False, False]], [[True, True]]])
    times = last_seen(seen, np.array([10, 20, 30]), np.array([[3, 4]]))
    assert times[:, 0].tolist() == [[3, 4], [10, 4], [10, 4], [30, 30]]


@pytest.mark.parametrize(
    ("seen", "expected_signals", "share"),
    [
        ("11110", "11110", 0.0),
        ("11000", "11110", 0.5),
        ("00000", "11111", 1.0),
        ("11001", "11110", 0.5),
        ("11100", "11100", NAN),
        ("00000", "00000", NAN),
    ],
    ids=["none lost", "half lost", "all lost", "a new one does not make up for it", "three expected", "none expected"],
)
def test_lost_share(seen: str, expected_signals: str, share: float) -> None:
    def flags(text: str) -> Bools:
        return np.array([[[c == "1" for c in text]]])

    assert lost_share(flags(seen), flags(expected_signals)).item() == pytest.approx(share, nan_ok=True)


N_SIGNALS = 6
USUAL = np.full((1, N_SIGNALS), 45.0)  # baseline (R, S)


def drops(cn0_dbhz: Floats, baseline: Floats = USUAL, recent: Bools | bool = True) -> tuple[Floats, Floats]:
    """Drop (E,) of one receiver, C/N0 (E, S), one epoch a second, and its baseline afterwards (S,); all signals seen of late."""
    epoch_ns = NS_PER_S * np.arange(1, len(cn0_dbhz) + 1)
    drop, after = cn0_drop_db(cn0_dbhz[:, None, :], np.broadcast_to(recent, cn0_dbhz[:, None, :].shape), epoch_ns, baseline, 0)
    return drop[:, 0], after[0]


def test_a_drop_shows_in_its_first_epoch() -> None:
    assert drops(np.full((1, N_SIGNALS), 38.0))[0].tolist() == [7.0]


def test_the_drop_is_the_mean_over_signals() -> None:
    assert drops(np.array([[45.0, 45.0, 45.0, 33.0, 33.0, 33.0]]))[0].tolist() == [6.0]


def test_a_rise_is_a_negative_drop() -> None:
    assert drops(np.full((1, N_SIGNALS), 50.0))[0].tolist() == [-5.0]


def test_the_baseline_follows_within_300_s() -> None:
    # One time constant: 1 - 1/e of a 2 dB step.
    _, after = drops(np.full((300, N_SIGNALS), 43.0))
    assert after == pytest.approx(np.full(N_SIGNALS, 45.0 - 2.0 * (1.0 - np.exp(-1.0))), abs=1e-9)


def test_the_baseline_hardly_moves_while_the_signals_are_low() -> None:
    _, after = drops(np.full((60, N_SIGNALS), 35.0))
    assert after == pytest.approx(np.full(N_SIGNALS, 45.0 - 10.0 * (1.0 - np.exp(-60.0 / 3600.0))), abs=1e-9)


def test_jamming_of_ten_minutes_is_seen_to_its_end() -> None:
    assert drops(np.full((600, N_SIGNALS), 35.0))[0].min() > 6.0


def test_a_new_signal_begins_where_it_is() -> None:
    _, after = drops(np.full((1, N_SIGNALS), 40.0), np.full((1, N_SIGNALS), NAN))
    assert after.tolist() == [40.0] * N_SIGNALS


def test_a_new_signal_is_no_drop() -> None:
    assert drops(np.full((1, N_SIGNALS), 40.0), np.full((1, N_SIGNALS), NAN))[0].tolist() == [0.0]


def test_a_signal_not_seen_keeps_its_baseline() -> None:
    _, after = drops(np.array([[NAN, 45.0, 45.0, 45.0, 45.0, 45.0]]))
    assert after[0] == 45.0


def test_a_signal_not_seen_of_late_begins_where_it_is() -> None:
    drop, after = drops(np.full((1, N_SIGNALS), 30.0), recent=False)
    assert (drop[0], after.tolist()) == (0.0, [30.0] * N_SIGNALS)


def test_without_cn0_there_is_no_drop() -> None:
    assert np.isnan(drops(np.full((3, N_SIGNALS), NAN))[0]).all()


def test_an_epoch_without_cn0_says_nothing_of_itself() -> None:
    cn0 = np.full((3, N_SIGNALS), 45.0)
    cn0[1] = NAN
    assert np.isnan(drops(cn0)[0]).tolist() == [False, True, False]


def test_cutting_a_stream_changes_no_drop() -> None:
    cn0 = 45.0 + np.random.default_rng(1).normal(0.0, 3.0, (40, 2, N_SIGNALS))
    epoch_ns, start = NS_PER_S * np.arange(1, 41), np.full((2, N_SIGNALS), NAN)
    recent = np.arange(40)[:, None, None] % 11 != 5 * np.ones((1, 2, N_SIGNALS), dtype=np.int64)
    whole, _ = cn0_drop_db(cn0, recent, epoch_ns, start, 0)
    first, between = cn0_drop_db(cn0[:17], recent[:17], epoch_ns[:17], start, 0)
    second, _ = cn0_drop_db(cn0[17:], recent[17:], epoch_ns[17:], between, int(epoch_ns[16]))
    assert np.concatenate((first, second)).tolist() == whole.tolist()


@pytest.mark.parametrize(
    ("per_receiver", "second"),
    [((1.0, 9.0, 3.0), 3.0), ((9.0, 9.0, 0.0), 9.0), ((1.0, NAN, 3.0), 1.0), ((NAN, NAN, 3.0), NAN), ((NAN, NAN, NAN), NAN)],
    ids=["of three", "of equal ones", "of two", "of one", "of none"],
)
def test_second_worst(per_receiver: tuple[float, ...], second: float) -> None:
    assert second_worst(np.array([per_receiver]))[0] == pytest.approx(second, nan_ok=True)
