"""`wayside station configure`: the receivers' message set, written through pyubx2 and read back key by key.

Source: u-blox F9 HPG 1.51 interface description (UBX-CFG-VALSET, UBX-CFG-VALGET, UBX-MON-VER, configuration items). A receiver keeps
sending its other messages meanwhile: the answers are picked out of the stream.
"""

import contextlib
import struct
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from pyubx2 import POLL, POLL_LAYER_RAM, SET_LAYER_BBR, SET_LAYER_FLASH, SET_LAYER_RAM, UBXMessage, cfgname2key

from integrity.errors import ConfigError, LinkError
from integrity.gnss.gps_time import NS_PER_S
from integrity.gnss.ubx.framing import Frame, Framer
from recordings.site_file import SiteFile
from recordings.sources.kinds import Source, parse_source
from recordings.sources.links import Link, Wake

ACK_NAK, ACK_ACK = (0x05, 0x00), (0x05, 0x01)
CFG_VALSET, CFG_VALGET = (0x06, 0x8A), (0x06, 0x8B)
MON_VER = (0x0A, 0x04)
KEPT_IN = SET_LAYER_RAM | SET_LAYER_BBR | SET_LAYER_FLASH
EPOCH_MESSAGES = ("RXM_RAWX", "RXM_SFRBX", "NAV_PVT")
SECOND_MESSAGES = ("NAV_STATUS", "MON_RF", "SEC_SIG")
PORTS = ("UART1", "USB")
ANSWER_WITHIN_S = 2.0
ATTEMPTS = 3
NS_PER_MS = 1_000_000
LONGEST_INTERVAL_MS = 65535
VALUE_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8}  # bytes, by bits 28 to 30 of the key; 1 is a single bit in a byte
CONFIGURABLE = ("serial", "tcp")

Say = Callable[[str, str], None]
T = TypeVar("T")


@dataclass(frozen=True)
class ConfiguredReceiver:
    """A receiver that holds the whole message set. `model` and `firmware` as MON-VER gives them, "unknown" where it does not."""

    receiver: str
    model: str
    firmware: str
    keys: int


def configure(site: SiteFile, say: Say) -> list[ConfiguredReceiver]:
    """Configure every receiver with a serial or TCP source, and read it all back; `say(receiver, line)` tells of each step.

    Every receiver is tried. LinkError after that, a line for each thing that is not as it should be, or where no receiver can be
    configured; ConfigError before anything is sent where no receiver could keep the epoch interval.
    """
    settings = message_set(site.config.epoch_interval_ns)
    configured: list[ConfiguredReceiver] = []
    problems: list[str] = []
    reachable = 0
    for receiver, url in site.sources.items():
        kind = url.partition(":")[0] if url is not None else "no source"
        if url is None or kind not in CONFIGURABLE:
            say(receiver, f"skipped ({kind}): nothing can be sent to it; to configure it, connect it once by serial:// or tcp://")
            continue
        reachable += 1
        try:
            identity, wrong = _configure_receiver(parse_source(url), settings, partial(say, receiver))
        except LinkError as error:
            wrong = [str(error)]
        if wrong:
            problems += [f"receiver {receiver}: {line}" for line in wrong]
            say(receiver, "NOT configured")
        else:
            configured.append(ConfiguredReceiver(receiver, *identity, len(settings)))
            say(receiver, f"configured: {len(settings)} keys set in RAM, battery-backed RAM and flash, and read back")
    if not reachable:
        raise LinkError(f"{site.file}: no receiver has a source that it can be configured by: expected serial:// or tcp://")
    if problems:
        raise LinkError("\n".join(problems))
    return configured


def message_set(epoch_interval_ns: int) -> dict[str, int]:
    """What a station needs of a receiver, by key: raw measurements and navigation data each epoch, how it is about once a second.

    ConfigError for an interval that is not a whole number of milliseconds, or above 65.535 s: no receiver can keep it.
    """
    interval_ms, rest = divmod(epoch_interval_ns, NS_PER_MS)
    if rest or not 1 <= interval_ms <= LONGEST_INTERVAL_MS:
        raise ConfigError(
            f"site.epoch_interval_s = {epoch_interval_ns / NS_PER_S:g}: a receiver keeps whole milliseconds up to"
            f" {LONGEST_INTERVAL_MS / 1000} s: choose such an interval, 1.0 for example"
        )
    every_epoch = dict.fromkeys(EPOCH_MESSAGES, 1)
    every_second = dict.fromkeys(SECOND_MESSAGES, min(255, max(1, round(NS_PER_S / epoch_interval_ns))))
    rates = {f"CFG_MSGOUT_UBX_{name}_{port}": n for name, n in (every_epoch | every_second).items() for port in PORTS}
    protocols = {f"CFG_{port}OUTPROT_{protocol}": on for port in PORTS for protocol, on in (("UBX", 1), ("NMEA", 0))}
    timing = {"CFG_RATE_MEAS": interval_ms, "CFG_RATE_NAV": 1, "CFG_RATE_TIMEREF": 1, "CFG_NAVSPG_DYNMODEL": 2}  # GPS time; stationary
    return protocols | rates | timing


def _configure_receiver(source: Source, settings: dict[str, int], tell: Callable[[str], None]) -> tuple[tuple[str, str], list[str]]:
    """Model and firmware, and what is wrong in the end, a line each; LinkError where the receiver cannot be talked to."""
    with contextlib.closing(Wake()) as wake, contextlib.closing(source.open(wake, tell)) as link:
        dialogue = _Dialogue(link)
        model, firmware = dialogue.identity()
        tell(f"{source.opened} {source.url}: {model}, firmware {firmware}")
        refused = dialogue.set(settings)
        return (model, firmware), _differences(settings, refused, dialogue.get(settings))


def _differences(settings: dict[str, int], refused: list[str], found: dict[str, int]) -> list[str]:
    """What is not as it should be, with what to do; nothing where the receiver holds all of it."""
    if len(refused) == len(settings):
        return [
            f"refused all {len(settings)} keys: its configuration is locked, or it has no flash memory, or it is older than generation 9"
        ]
    wrong = []
    for key, wanted in settings.items():
        if key not in found:
            wrong.append(f"{key}: wanted {wanted}, found nothing, the receiver does not know this key: update its firmware")
        elif key in refused:
            wrong.append(f"{key}: wanted {wanted}, refused, found {found[key]}: see in its manual whether this model can do that")
        elif found[key] != wanted:
            wrong.append(
                f"{key}: wanted {wanted}, accepted, found {found[key]}: does another program configure it too? Stop that, run this again"
            )
    return wrong


class _Dialogue:
    """Questions to one receiver, and its answers picked out of everything else that it sends."""

    def __init__(self, link: Link) -> None:
        self._link = link
        self._framer = Framer()
        self._heard_bytes = 0
        self._heard_frames = 0

    def identity(self) -> tuple[str, str]:
        """Model and firmware. Source: UBX-MON-VER: 30 bytes of software, 10 of hardware, then extensions of 30."""
        version = self._ask(UBXMessage("MON", "MON-VER", POLL), lambda frame: frame.payload if _kind(frame) == MON_VER else None)
        lines = [version[:30], *(version[i : i + 30] for i in range(40, len(version), 30))]
        texts = [line.partition(b"\0")[0].decode("ascii", "replace").strip() for line in lines]
        named = dict(text.split("=", 1) for text in texts if "=" in text)
        return named.get("MOD", "unknown"), named.get("FWVER", texts[0] or "unknown")

    def set(self, settings: dict[str, int]) -> list[str]:
        """Set the keys, all at once, or one by one where the receiver refuses that; those that it refuses even so."""
        if self._set(settings):
            return []
        return [key for key, value in settings.items() if not self._set({key: value})]

    def get(self, keys: Iterable[str]) -> dict[str, int]:
        """What the receiver works with now; a key that it does not know is missing. One such key makes it refuse the whole question."""
        found = self._get(keys)
        for key in keys:
            if key not in found:
                found |= self._get([key])
        return found

    def _set(self, settings: dict[str, int]) -> bool:
        return self._ask(UBXMessage.config_set(KEPT_IN, 0, list(settings.items())), lambda frame: _acknowledged(frame, CFG_VALSET))

    def _get(self, keys: Iterable[str]) -> dict[str, int]:
        names = {cfgname2key(key)[0]: key for key in keys}

        def answer(frame: Frame) -> dict[str, int] | None:
            if _acknowledged(frame, CFG_VALGET) is False:
                return {}
            values = _values(frame.payload) if _kind(frame) == CFG_VALGET else {}
            if not values or values.keys() - names.keys():  # another message, or a late answer to another question
                return None
            return {names[number]: value for number, value in values.items()}

        return self._ask(UBXMessage.config_poll(POLL_LAYER_RAM, 0, list(keys)), answer)

    def _ask(self, question: UBXMessage, answer: Callable[[Frame], T | None]) -> T:
        """Send a question until a frame answers it; LinkError where none does, or where the link is lost."""
        try:
            for _ in range(ATTEMPTS):
                self._link.write(question.serialize())
                until_s = time.monotonic() + ANSWER_WITHIN_S
                while (left_s := until_s - time.monotonic()) > 0:
                    data = self._link.read(left_s) or b""
                    self._heard_bytes += len(data)
                    for frame in self._framer.feed(data):
                        self._heard_frames += 1
                        answered = answer(frame)
                        if answered is not None:
                            return answered
        except LinkError as error:
            raise LinkError(f"link lost before {question.identity} was answered: {error}: run this again") from None
        raise LinkError(f"no answer to {question.identity} in {ATTEMPTS} attempts of {ANSWER_WITHIN_S:g} s: {self._diagnosis()}")

    def _diagnosis(self) -> str:
        if self._heard_frames:
            return "it sends UBX messages but does not answer: is the line to its input connected, and UBX input on?"
        if self._heard_bytes:
            return "bytes come in, but no UBX messages: is the baud rate right, is it a u-blox receiver?"
        return "nothing comes in: is it switched on, is this its port, is the baud rate right?"


def _kind(frame: Frame) -> tuple[int, int]:
    return frame.message_class, frame.message_id


def _acknowledged(frame: Frame, question: tuple[int, int]) -> bool | None:
    """Whether the receiver took a message of this kind; None where the frame does not say."""
    if _kind(frame) not in (ACK_ACK, ACK_NAK) or tuple(frame.payload) != question:
        return None
    return _kind(frame) == ACK_ACK


def _values(payload: bytes) -> dict[int, int]:
    """Values by number of key. Source: UBX-CFG-VALGET: 4 bytes, then a key of 4 bytes and its value, as long as the key says."""
    values = {}
    at = 4
    while at + 4 < len(payload):
        (key,) = struct.unpack_from("<I", payload, at)
        end = at + 4 + VALUE_SIZES.get(key >> 28 & 0x7, len(payload))
        values[key] = int.from_bytes(payload[at + 4 : end], "little")
        at = end
    return values
