"""What a station puts on the air: health first and at once, then the record of why, alerts, and answers to those who ask.

The decision thread calls `health`, `epoch` and `alert`; none of them waits for a reader. Queries are answered in threads of the link.
"""

import time
from typing import NamedTuple

from integrity.config import SiteConfig
from integrity.limits import derive
from integrity.messages import wayside_pb2 as pb
from integrity.messages.key_expressions import ALERT, ALIVE, CHALLENGE, EPOCH, HEALTH, INFO, site_key
from integrity.messages.signatures import SigningKey, sign_challenge_reply, sign_health
from integrity.messages.verification import NONCE_BYTES
from integrity.triangle import reference_triangle
from recordings.link import Link, QueryRefused

REMEMBERED_ALERTS = 2000  # changes of state: weeks of a sound station, and below 1 MB


class _Latest(NamedTuple):
    """The health that was put last: one value, so that a query sees both of it or neither."""

    sequence: int = 0
    signed: bytes = b""


class Publisher:
    """Speaks for one site from now until the link is closed. `boot_id` is 16 random bytes, drawn when the station started."""

    def __init__(self, link: Link, site: SiteConfig, key: SigningKey, boot_id: bytes, software: str) -> None:
        self._key = key
        self._boot_id = boot_id
        self._latest = _Latest()
        self._health_key = site_key(site.site_id, HEALTH)
        self._challenge_key = site_key(site.site_id, CHALLENGE)
        info = site_info(site, key.key_id, boot_id, software).SerializeToString()
        self._put_health = link.urgent(self._health_key, "wayside.v1.SignedHealth")
        self._put_epoch = link.droppable(site_key(site.site_id, EPOCH), "wayside.v1.EpochReport")
        self._put_alert = link.remembered(site_key(site.site_id, ALERT), "wayside.v1.Alert", REMEMBERED_ALERTS)
        link.answer(self._health_key, "wayside.v1.SignedHealth", self._answer_health)
        link.answer(self._challenge_key, "wayside.v1.SignedChallengeReply", self._answer_challenge)
        link.answer(site_key(site.site_id, INFO), "wayside.v1.SiteInfo", lambda _: info)
        link.alive(site_key(site.site_id, ALIVE))  # last: who sees it may ask

    def health(self, message: pb.Health) -> None:
        """Sign and put. Call it before `epoch` and `alert` of the same decision."""
        assert message.boot_id == self._boot_id, "health of another boot than the challenge answers for: no train would believe it"
        signed = sign_health(self._key, self._health_key, message).SerializeToString()
        self._put_health(signed)
        self._latest = _Latest(message.sequence, signed)

    def epoch(self, message: pb.EpochReport) -> None:
        """The record of why."""
        self._put_epoch(message.SerializeToString())

    def alert(self, message: pb.Alert) -> None:
        """One change of state; kept for those who come later."""
        self._put_alert(message.SerializeToString())

    def _answer_health(self, _: bytes) -> bytes:
        if not self._latest.signed:
            raise QueryRefused("no health has been published since this station started: ask again in a moment")
        return self._latest.signed

    def _answer_challenge(self, nonce: bytes) -> bytes:
        if len(nonce) != NONCE_BYTES:
            raise QueryRefused(f"nonce of {len(nonce)} bytes: expected {NONCE_BYTES} random ones")
        sequence = self._latest.sequence  # before the clock is read: the answer must not seem older than the health that it names
        reply = pb.ChallengeReply(nonce=nonce, boot_id=self._boot_id, issued_mono_ns=time.monotonic_ns(), sequence=sequence)
        return sign_challenge_reply(self._key, self._challenge_key, reply).SerializeToString()


def site_info(site: SiteConfig, key_id: bytes, boot_id: bytes, software: str) -> pb.SiteInfo:
    """What the site says of itself to anybody who asks."""
    points = {receiver.name: receiver.position_ecef_m for receiver in site.receivers}
    return pb.SiteInfo(
        site=site.site_id,
        frame=site.frame,
        frame_epoch=site.frame_epoch,
        triangle=[pb.SurveyedPoint(receiver=name, x_m=x, y_m=y, z_m=z) for name, (x, y, z) in points.items()],
        radius_m=derive(site, reference_triangle(site)).radius_m,
        key_id=key_id,
        software=software,
        config_sha256=site.config_sha256,
        boot_id=boot_id,
    )
