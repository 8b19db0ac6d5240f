"""What one receiver shows of its signals, and what it says of itself."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Floats
from integrity.gnss.receiver_status import Jamming, ReceiverStatus, Spoofing
from integrity.monitors.signal import GainMemory, Unusual, advance, gains, remarks, silent_on

NAN = float("nan")
NAMES = ("A", "B", "C")
UNUSUAL = Unusual(cn0_drop_db=6.0, lost_share=0.5, gain_drop=0.15)


def dropped(gain: Floats, step_s: int = 1) -> tuple[GainMemory, Floats]:
    """Of receivers whose gain (E, R) is told once a step."""
    return advance(GainMemory.empty(gain.shape[1]), NS_PER_S * step_s * np.arange(1, len(gain) + 1), gain)


def test_a_first_gain_is_the_usual_one() -> None:
    assert dropped(np.array([[0.6]]))[1].tolist() == [[0.0]]


def test_a_drop_shows_at_once() -> None:
    assert dropped(np.array([[0.6], [0.4]]))[1][1, 0] == pytest.approx(0.2)


def test_the_usual_gain_follows_within_an_hour() -> None:
    # One time constant: 1 - 1/e of the step.
    memory, _ = dropped(np.array([[0.6]] + [[0.4]] * 120), step_s=30)
    assert memory.usual[0] == pytest.approx(0.6 - 0.2 * (1.0 - np.exp(-1.0)), abs=1e-9)


def test_a_receiver_that_does_not_say_is_not_monitored() -> None:
    assert np.isnan(dropped(np.array([[0.6, NAN], [0.6, NAN]]))[1]).tolist() == [[False, True]] * 2


def test_a_receiver_that_falls_silent_keeps_its_usual_gain() -> None:
    assert dropped(np.array([[0.6], [NAN], [0.4]]))[1][2, 0] == pytest.approx(0.2)


def test_nobody_says_anything() -> None:
    assert np.isnan(dropped(np.full((3, 2), NAN))[1]).all()


@settings(max_examples=30, deadline=None)
@given(st.sets(st.integers(1, 11)), st.lists(st.sampled_from([0.2, 0.5, 0.6, NAN]), min_size=24, max_size=24))
def test_cutting_a_stream_changes_nothing(cuts: set[int], values: list[float]) -> None:
    gain, epoch_ns = np.array(values).reshape(12, 2), NS_PER_S * np.arange(1, 13)
    memory, parts = GainMemory.empty(2), []
    for begin, end in pairwise([0, *sorted(cuts), 12]):
        memory, drop = advance(memory, epoch_ns[begin:end], gain[begin:end])
        parts.append(drop)
    assert np.concatenate(parts).tobytes() == advance(GainMemory.empty(2), epoch_ns, gain)[1].tobytes()


def test_gains_are_what_was_said_last() -> None:
    first, second = (("A", ReceiverStatus(agc=0.5)),), (("A", ReceiverStatus(agc=0.4)), ("C", ReceiverStatus()))
    assert gains([(), first, first, second], NAMES)[:, 0] == pytest.approx([NAN, 0.5, 0.5, 0.4], nan_ok=True)


def test_gains_of_those_who_do_not_say() -> None:
    assert np.isnan(gains([(("A", ReceiverStatus(agc=0.5)),)], NAMES)[0]).tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("cn0_drop_db", "lost_share", "gain_drop", "words"),
    [
        (0.5, 0.0, 0.01, ()),
        (NAN, NAN, NAN, ()),
        (6.0, 0.5, 0.15, ()),
        (9.0, 0.0, 0.0, ("B: C/N0 fell by 9.0 dB: interference?",)),
        (9.0, 0.75, 0.2, ("B: C/N0 fell by 9.0 dB, 75% of its signals are gone, its gain fell by 20% of its range: interference?",)),
        (NAN, 0.75, NAN, ("B: 75% of its signals are gone: interference?",)),
        (0.0, 0.0, 0.2, ("B: its gain fell by 20% of its range: a transmitter stronger than the sky?",)),
        (-8.0, 0.0, 0.2, ("B: C/N0 rose by 8.0 dB, its gain fell by 20% of its range: a transmitter stronger than the sky?",)),
        (-8.0, 0.0, NAN, ("B: C/N0 rose by 8.0 dB: a transmitter stronger than the sky?",)),
    ],
    ids=["usual", "says nothing", "at the edge", "weaker", "jammed", "lost", "louder", "stronger and louder", "stronger"],
)
def test_words_for_one_receiver(cn0_drop_db: float, lost_share: float, gain_drop: float, words: tuple[str, ...]) -> None:
    cn0, lost, gain = (np.array([0.0, x, NAN]) for x in (cn0_drop_db, lost_share, gain_drop))
    assert remarks(NAMES, cn0, lost, gain, UNUSUAL) == words


def test_what_receivers_do_not_say() -> None:
    statuses = (("A", ReceiverStatus(agc=0.5, jamming=Jamming.NONE_SEEN, spoofing=Spoofing.NONE_SEEN)), ("B", ReceiverStatus(agc=0.5)))
    assert silent_on(statuses, ("A", "B")) == ("jamming_B", "spoofing_B")


def test_a_receiver_that_never_spoke_is_silent_on_everything() -> None:
    assert silent_on((), ("C",)) == ("agc_C", "jamming_C", "spoofing_C")
