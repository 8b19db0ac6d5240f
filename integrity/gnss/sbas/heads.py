"""What holds for all satellites, as arrays over epochs. Heads change seldom: each is read once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.observations import Bools, Floats, Ints
from integrity.gnss.sbas.degradation import LONG_TERM_TIMEOUT_S, SERVICE_TIMEOUT_S, Terms, older
from integrity.gnss.sbas.grid import NEVER
from integrity.gnss.sbas.messages import RECEIVED_AFTER_NS
from integrity.gnss.sbas.store import MISSED_MESSAGES, Head, State


class Heads(NamedTuple):
    """Each (E, 1). `service` is delta UDRE of type 27 here, 1 where it is not sent, NaN where it is not known in whole."""

    blocked: Bools
    silent: Bools
    mask_ns: Ints
    t_lat_s: Floats
    I_fc_s: Floats
    covariance: Bools
    service: Floats
    terms: Terms


_TERMS = [name for name in Terms._fields if name != "present"]


def heads_of(states: Sequence[State], lat_deg: float, lon_deg: float, mode: int) -> Heads:
    """For a place, in PA or NPA."""
    t = np.array([state.t_ns for state in states], dtype=np.int64)[:, None]
    heads = [state.head for state in states]
    last_ns, blocked_ns, mask_ns, degradation_ns, service_ns, covariance_ns = np.array(
        [(h.last_ns, h.blocked_until_ns, h.mask_ns, h.degradation_ns, h.service_ns, h.covariance_ns) for h in heads], dtype=np.int64
    ).T[:, :, None]
    terms = np.array([_terms(head) for head in heads]).T[:, :, None]
    present = ~older(t, degradation_ns, LONG_TERM_TIMEOUT_S[mode])
    return Heads(
        blocked=t < blocked_ns,
        silent=t - last_ns - RECEIVED_AFTER_NS >= MISSED_MESSAGES * NS_PER_S,
        mask_ns=mask_ns,
        t_lat_s=np.array([[head.t_lat_s] for head in heads]),
        I_fc_s=np.array([[head.I_fc_s[mode]] for head in heads]),
        covariance=covariance_ns != NEVER,
        service=_service(heads, older(t, service_ns, SERVICE_TIMEOUT_S[mode]), lat_deg, lon_deg),
        terms=Terms(present, **dict(zip(_TERMS, terms, strict=True)))._replace(RSS_UDRE=terms[_TERMS.index("RSS_UDRE")] != 0.0),
    )


def _terms(head: Head) -> tuple[float, ...]:
    if head.degradation is None:
        return (0.0,) * len(_TERMS)
    return tuple(float(getattr(head.degradation, name)) for name in _TERMS)


def _service(heads: Sequence[Head], timed_out: Bools, lat_deg: float, lon_deg: float) -> Floats:
    """delta UDRE (E, 1)."""
    known: dict[int, float] = {}
    factors = []
    for head in heads:
        key = id(head.services)
        if key not in known:
            factor = head.services.delta_udre(lat_deg, lon_deg)
            known[key] = np.nan if factor is None else factor
        factors.append(known[key])
    sent = np.array([[head.service_ns != NEVER] for head in heads])
    return np.where(sent, np.where(timed_out, np.nan, np.array(factors)[:, None]), 1.0)
