"""A synthetic log of RXM-RAWX, no recording: 14,400 epochs of 35 measurements, of all systems and signals, satellites coming and going.

`python -m tests.benchmarks.synthetic_ubx FILE` writes it. The same seed gives the same bytes.
"""

import sys
from pathlib import Path

import numpy as np

from integrity.gnss.ubx.framing import frame_bytes
from integrity.gnss.ubx.identifiers import SIGNALS
from integrity.gnss.ubx.rawx import RAWX_DTYPE, RAWX_HEADER, RXM_RAWX

EPOCHS = 14_400
MEASUREMENTS = 35
FIRST_WEEK, FIRST_TOW_S = 2380, 598_000  # the week ends within the log
EPOCHS_A_CHANGE = 90  # one signal goes and another comes
TWICE = {(3, 1), (3, 3), (3, 10)}  # BeiDou's D2: of a signal that stands in the table with D1 already
RANGE_M = {"R": 2.1e7, "C": 3.6e7, "J": 3.8e7, "S": 3.7e7}


def signals_heard() -> np.ndarray:
    """gnssId, svId, sigId of the signals in view one after the other, (n, 3): the first 35, then from the second on, and so on."""
    rng = np.random.default_rng(1)
    every = [(gnss, sv, sig) for (gnss, sig), s in SIGNALS.items() if (gnss, sig) not in TWICE for sv in range(s.first, s.last + 1)]
    return rng.permutation(np.array(every, dtype=np.uint8))[: MEASUREMENTS + EPOCHS // EPOCHS_A_CHANGE]


def log() -> bytes:
    """The whole log, 16 MB."""
    rng = np.random.default_rng(2)
    heard = signals_heard()
    least_m = np.array([RANGE_M.get(SIGNALS[int(gnss), int(sig)].system, 2.2e7) for gnss, _, sig in heard])
    frames = []
    for epoch in range(EPOCHS):
        now = np.arange(MEASUREMENTS) + epoch // EPOCHS_A_CHANGE
        m = np.zeros(MEASUREMENTS, dtype=RAWX_DTYPE)
        m["gnss_id"], m["sv_id"], m["sig_id"] = heard[now].T
        m["pr_m"] = least_m[now] + rng.uniform(0.0, 3e6, MEASUREMENTS)
        m["cp_cycles"] = m["pr_m"] / 0.19
        m["do_hz"] = rng.uniform(-4e3, 4e3, MEASUREMENTS)
        m["freq_id"] = np.where(m["gnss_id"] == 6, m["sv_id"] % 14, 0)
        m["locktime_ms"] = np.minimum(64_500, 1000 * (epoch % EPOCHS_A_CHANGE))
        m["cno_dbhz"] = rng.integers(20, 52, MEASUREMENTS)
        m["pr_stdev"], m["cp_stdev"], m["do_stdev"] = 4, 1, 2
        m["trk_stat"] = rng.choice([0b0001, 0b0011, 0b0111, 0b1111], MEASUREMENTS, p=(0.02, 0.03, 0.05, 0.9))
        tow_s = FIRST_TOW_S + epoch
        header = RAWX_HEADER.pack(tow_s % 604_800 + 0.0, FIRST_WEEK + tow_s // 604_800, 18, MEASUREMENTS, 1, 1)
        frames.append(frame_bytes(*RXM_RAWX, header + m.tobytes()))
    return b"".join(frames)


if __name__ == "__main__":
    Path(sys.argv[1]).write_bytes(log())
