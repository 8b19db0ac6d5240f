"""The link over Zenoh: the only file that knows it. Bytes and key expressions in and out, arrival times stamped, nothing found by itself.

No multicast and no gossip: a process talks to the endpoints it was given and to those who dial it. A station is a peer, at which readers
and routers may call; a reader is a client. At endpoints `tls/HOST:PORT` both ends show certificates of one authority, and a station lets
in only the names that it was given, to read and ask and nothing else. (Zenoh believes the public authorities of the web too where it
dials: who poses as a station by one of those can withhold, but signs nothing.) Everything is put with congestion
control DROP: a reader that does not keep up never holds a station. Callbacks run in the threads that read the link (of alerts and of
who is there: in threads of their own), where they stamp and hand on. A process that ends without closing its session hangs, so a link is
only to be had by `with`.
"""

import json
import re
import sys
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import zenoh
from zenoh import ext
from zenoh.handlers import Callback

from integrity.errors import LinkError
from integrity.messages.key_expressions import ALERT, site_key
from recordings.site_schema import ENDPOINT_PATTERN, is_secured
from recordings.tls_files import TlsFiles

LEASE_MS = 1000  # a peer that is silent for so long is gone; its death without a word shows at once over TCP
URGENT_BATCHES = 16  # on their way out, the most that Zenoh takes; of its own 2 the third message of one instant is dropped after 1 ms
RETRY_MS = (200, 1000)  # first and longest pause between attempts to connect
ALERT_HEARTBEAT_S = 0.5  # how late a lost last alert is noticed
TIME_IS_UP = "Timeout"  # the error that Zenoh itself answers with

Put = Callable[[bytes], None]


class Arrival(NamedTuple):
    """Bytes that came in, by put or by answer; `mono_ns` is this process's clock at that moment. An answer may be an error in words."""

    key_expr: str
    data: bytes
    mono_ns: int
    error: str = ""


class Access(NamedTuple):
    """Who may read what a site says, and ask it: common names of certificates. Nobody else may anything."""

    site: str
    readers: tuple[str, ...]


class QueryRefused(Exception):
    """Raised by the answerer of a query: its text goes back as an error."""


@contextmanager
def open_link(listen: Sequence[str], connect: Sequence[str], tls: TlsFiles | None = None, access: Access | None = None) -> Iterator["Link"]:
    """For one that speaks. It takes calls at `listen`; a router to be dialled that is not there is tried again and again, for ever.

    With `access` only its readers are served, whoever dialled; without it everybody is. Raises LinkError for an endpoint that makes no
    sense, and for one that cannot be listened at.
    """
    _check_endpoints((*listen, *connect), tls)
    config = _config("peer", listen, connect, tls)
    if access is not None:
        config.insert_json5("access_control", json.dumps(_access_control(access)))
    session = _open(config, (*listen, *connect))
    with session:
        yield Link(session)


@contextmanager
def dial_link(connect: Sequence[str], on_waiting: Callable[[], None], tls: TlsFiles | None = None) -> Iterator["Link"]:
    """For one that listens to others: to the first of the endpoints that is there, and to it again whenever it was lost.

    It takes no calls. Until somebody is there it tries, for ever; `on_waiting` is called once, when the first attempt has failed.
    Raises LinkError for an endpoint that makes no sense.
    """
    _check_endpoints(connect, tls)
    attempts = 0
    while True:
        try:
            session = _open(_config("client", [], connect, tls), connect)
            break
        except _NobodyThere:
            attempts += 1
        if attempts == 1:
            on_waiting()
        time.sleep(RETRY_MS[1] / 1000)
    with session:
        yield Link(session)


def nobody_at(endpoints: Sequence[str]) -> str:
    """What is to be said while a link is being dialled in vain. Zenoh does not tell a refusal from a wire that is cut."""
    refused = ", or certificates are refused: the other end's log may say why" if any(map(is_secured, endpoints)) else ""
    return f"nobody is at {', '.join(endpoints)}{refused}; it is tried again every second"


class Link:
    """An open session. What is declared on it lives as long as the session."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._kept: list[object] = []  # Zenoh undeclares what nobody holds

    @property
    def connected(self) -> bool:
        """Whether anybody is at the other end, whoever it is."""
        return bool(self._session.info.peers_zid() or self._session.info.routers_zid())

    def urgent(self, key_expr: str, schema: str) -> Put:
        """For what must not wait: sent at once, before everything else. `schema` is the full name of the message."""
        publisher = self._session.declare_publisher(key_expr, encoding=_encoding(schema), **_URGENT)
        return self._put_of(publisher)

    def droppable(self, key_expr: str, schema: str) -> Put:
        """For what may be lost, and is sent after everything else."""
        publisher = self._session.declare_publisher(
            key_expr,
            encoding=_encoding(schema),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.DATA_LOW,
        )
        return self._put_of(publisher)

    def remembered(self, key_expr: str, schema: str, most: int) -> Put:
        """For what those who come late shall have too: the last `most` are kept for them."""
        publisher = ext.declare_advanced_publisher(
            self._session,
            key_expr,
            encoding=_encoding(schema),
            cache=ext.CacheConfig(max_samples=most),
            publisher_detection=True,
            sample_miss_detection=ext.MissDetectionConfig(heartbeat=ALERT_HEARTBEAT_S),  # type: ignore[call-arg]
            **_URGENT,
        )
        return self._put_of(publisher)

    def alive(self, key_expr: str) -> None:
        """Say that this process is there, for as long as it is."""
        self._kept.append(self._session.liveliness().declare_token(key_expr))

    def answer(self, key_expr: str, schema: str, answerer: Callable[[bytes], bytes]) -> None:
        """Answer queries: `answerer` takes the query's bytes, in a thread of Zenoh's, and may raise QueryRefused."""
        encoding = _encoding(schema)

        def reply(query: zenoh.Query) -> None:
            try:
                query.reply(key_expr, answerer(bytes(query.payload or b"")), encoding=encoding, **_ASKED)
            except QueryRefused as refusal:
                query.reply_err(str(refusal))

        self._kept.append(self._session.declare_queryable(key_expr, _at_once(reply)))

    def subscribe(self, key_expr: str, take: Callable[[Arrival], None]) -> None:
        """Hand on whatever is put at the key expression from now on."""
        self._kept.append(self._session.declare_subscriber(key_expr, _at_once(lambda sample: take(_arrival(sample)))))

    def subscribe_remembered(self, key_expr: str, most: int, take: Callable[[Arrival], None]) -> None:
        """The same for what is published as `remembered`: up to `most` from before come first."""
        subscriber = ext.declare_advanced_subscriber(
            self._session,
            key_expr,
            _said_not_lost(lambda sample: take(_arrival(sample))),
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=most),
            recovery=ext.RecoveryConfig(heartbeat=True),  # type: ignore[call-arg]
        )
        self._kept.append(subscriber)

    def watch(self, key_expr: str, take: Callable[[bool], None]) -> None:
        """Hand on whether somebody says `alive` there, as it is now and whenever it changes."""
        watcher = self._session.liveliness().declare_subscriber(
            key_expr, _said_not_lost(lambda sample: take(sample.kind == zenoh.SampleKind.PUT)), history=True
        )
        self._kept.append(watcher)

    def ask(self, key_expr: str, payload: bytes, timeout_s: float, take: Callable[[Arrival], None]) -> None:
        """Send a query and return at once; every answer within the time is handed on. Nobody there, or silent: none comes."""

        def hand_on(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                take(_arrival(reply.ok))
            elif reply.err is not None and (words := bytes(reply.err.payload).decode(errors="replace")) != TIME_IS_UP:
                take(Arrival(key_expr, b"", time.monotonic_ns(), words))

        self._session.get(
            key_expr,
            _at_once(hand_on),
            payload=payload,
            timeout=timeout_s,
            target=zenoh.QueryTarget.ALL,  # not the nearest alone: that may be a stranger
            consolidation=zenoh.ConsolidationMode.NONE,
            **_ASKED,
        )

    def _put_of(self, publisher: zenoh.Publisher | ext.AdvancedPublisher) -> Put:
        self._kept.append(publisher)

        def put(data: bytes) -> None:
            publisher.put(data)

        return put


_URGENT: dict[str, Any] = {
    "congestion_control": zenoh.CongestionControl.DROP,
    "priority": zenoh.Priority.REAL_TIME,
    "express": True,
}
_ASKED = _URGENT | {"express": False}  # questions and answers may share a batch: many at once would else be dropped


def _arrival(sample: zenoh.Sample) -> Arrival:
    return Arrival(str(sample.key_expr), bytes(sample.payload), time.monotonic_ns())


def _encoding(schema: str) -> zenoh.Encoding:
    return zenoh.Encoding("application/protobuf").with_schema(schema)


def _at_once(callback: Callable[[Any], None]) -> "Callback[Any]":
    """One that is called in the thread that reads the link, for what is short. Zenoh would else start a thread for each question."""
    return Callback(_said_not_lost(callback), indirect=False)


def _said_not_lost(callback: Callable[[Any], None]) -> Callable[[Any], None]:
    """A callback whose errors are said on stderr and go no further: Zenoh's thread has other calls to make."""

    def wrapped(argument: Any) -> None:
        try:
            callback(argument)
        except Exception:
            print(f"wayside: a callback of the link failed:\n{traceback.format_exc()}", file=sys.stderr)

    return wrapped


class _NobodyThere(LinkError):
    """None of the endpoints takes a call now."""


def _check_endpoints(endpoints: Sequence[str], tls: TlsFiles | None) -> None:
    """Zenoh itself takes some that lead nowhere, such as a host without a port, and tries them for ever."""
    for endpoint in endpoints:
        if not re.fullmatch(ENDPOINT_PATTERN, endpoint):
            raise LinkError(f"endpoint {endpoint!r}: expected PROTOCOL/HOST:PORT, such as tcp/127.0.0.1:7447")
        if is_secured(endpoint) and tls is None:
            raise LinkError(f"endpoint {endpoint!r}: needs certificates: give them, or an endpoint such as tcp/127.0.0.1:7447")


def _config(mode: str, listen: Sequence[str], connect: Sequence[str], tls: TlsFiles | None) -> zenoh.Config:
    """A router hands nothing from one peer to another, so that those who only read are clients (measured with 1.10.2)."""
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": mode,
        "listen/endpoints": list(listen),
        "listen/exit_on_failure": True,
        "connect/endpoints": list(connect),
        "connect/exit_on_failure": mode == "client",
        "connect/retry": {"period_init_ms": RETRY_MS[0], "period_max_ms": RETRY_MS[1], "period_increase_factor": 2},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/size/real_time": URGENT_BATCHES,
        "transport/shared_memory/enabled": False,  # not used by messages so small; with it a router takes 351 of one machine and no more
        "timestamping/enabled": True,
    }
    if tls is not None:
        settings["transport/link/tls"] = {
            "root_ca_certificate": str(tls.root_ca),
            "listen_certificate": str(tls.certificate),
            "listen_private_key": str(tls.private_key),
            "connect_certificate": str(tls.certificate),
            "connect_private_key": str(tls.private_key),
            "enable_mtls": True,
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _access_control(access: Access) -> dict[str, object]:
    """A rule for what comes in and one for what goes out.

    A rule covers what lies wholly in it: who follows several sites by a wildcard may say so, and still gets this one's words alone. `**`
    does not reach what Zenoh keeps under `@adv`: lost and earlier alerts.
    """
    anywhere, here = ([site_key(site, "**"), site_key(site, f"{ALERT}/@adv/**")] for site in ("*", access.site))
    asks = ["declare_subscriber", "query", "declare_liveliness_subscriber", "liveliness_query"]
    told = ["put", "reply", "liveliness_token", "declare_queryable"]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            {"id": "asks", "permission": "allow", "flows": ["ingress"], "messages": asks, "key_exprs": anywhere},
            {"id": "told", "permission": "allow", "flows": ["egress"], "messages": told, "key_exprs": here},
        ],
        "subjects": [{"id": "readers", "cert_common_names": list(access.readers)}] if access.readers else [],
        "policies": [{"rules": ["asks", "told"], "subjects": ["readers"]}] if access.readers else [],
    }


def _open(config: zenoh.Config, endpoints: Sequence[str]) -> zenoh.Session:
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        if "Unable to connect" in str(error):
            raise _NobodyThere(f"endpoint {', '.join(endpoints)}: nobody is there") from error
        raise LinkError(_why_not_open(endpoints, str(error))) from error


def _why_not_open(endpoints: Sequence[str], error: str) -> str:
    """In words; Zenoh's own are full of paths of its sources."""
    endpoint = next((endpoint for endpoint in endpoints if endpoint in error), ", ".join(endpoints))
    if "Address already in use" in error:
        return f"endpoint {endpoint}: the port is in use: end the other process, or choose another port"
    if "assign requested address" in error:
        return f"endpoint {endpoint}: this machine has no such address: listen at tcp/0.0.0.0:PORT, or at an address of its own"
    if "Permission denied" in error:
        return f"endpoint {endpoint}: this user may not listen there: choose a port from 1024 on"
    reason = re.sub(r" at /\S+", "", error)
    return f"endpoint {endpoint}: cannot be opened ({reason}): expected PROTOCOL/HOST:PORT, such as tcp/127.0.0.1:7447"
