"""What all processes of `crowd` have to agree on: who there is, where, when, and whose word whom concerns."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from recordings.certificates import Role, new_authority, new_certificate
from recordings.keys import new_key
from recordings.tls_files import TlsFiles, files_beside

GOLDEN = 0.6180339887498949  # multiples of it spread evenly, neighbours far apart
FOLLOWED = 2  # stations of a train
PLAN, ROUTER = "plan.json", "router"
PERIOD_NS = 1_000_000_000
STATIONS_PER_PROCESS, TRAINS_PER_PROCESS = 50, 50  # of 100 trains, one thread of Python takes 0.1 s longer to verify what comes at once


@dataclass(frozen=True)
class Plan:
    """`spread_ms`: within so long after the full second all stations publish, each always at its own moment; `starts_within_ms`: so the
    trains begin to challenge. Message n belongs to the n-th second; measured are those after `settling_s`, `seconds` of them.
    `recover_messages`: as in the train file.
    """

    folder: str
    endpoint: str
    stations: int
    trains: int
    settling_s: int
    seconds: int
    spread_ms: float
    starts_within_ms: float
    recover_messages: int

    @property
    def last(self) -> int:
        """Of each station: the sequence of its last message."""
        return self.settling_s + self.seconds

    @property
    def secured(self) -> bool:
        return self.endpoint.startswith("tls")

    def sites(self) -> list[str]:
        return [f"s{k:03d}" for k in range(self.stations)]

    def train_ids(self) -> list[str]:
        return [f"t{k:03d}" for k in range(self.trains)]

    def followed(self, train: int) -> list[str]:
        """By the train of that number: neighbours, as on a line."""
        return [self.sites()[(train + k) % self.stations] for k in range(FOLLOWED)]

    def shares_of_stations(self) -> list[tuple[int, int]]:
        """Which of them stand in one process: the first, and the first not."""
        return _shares(self.stations, STATIONS_PER_PROCESS)

    def shares_of_trains(self) -> list[tuple[int, int]]:
        return _shares(self.trains, TRAINS_PER_PROCESS)

    def key_file(self, site: str) -> Path:
        return Path(self.folder) / "keys" / f"{site}.pem"

    def tls(self, name: str) -> TlsFiles | None:
        return files_beside(Path(self.folder) / f"{name}.pem") if self.secured else None

    def delay_ns(self, site: str) -> int:
        """From the full second to its message: evenly spread, neighbours far apart."""
        return round(self.sites().index(site) * GOLDEN % 1.0 * self.spread_ms * 1e6)

    def starts_ns(self, train: int) -> int:
        """After the first second: when it begins to challenge, and then does so every second."""
        return round(train * GOLDEN % 1.0 * self.starts_within_ms * 1e6)

    def write(self) -> None:
        (Path(self.folder) / PLAN).write_text(json.dumps(asdict(self)))


def _shares(count: int, most: int) -> list[tuple[int, int]]:
    """Of how many, in so few processes that none has more: as equal as can be."""
    parts = math.ceil(count / most)
    return [(count * k // parts, count * (k + 1) // parts) for k in range(parts)]


def read_plan(folder: str) -> Plan:
    return Plan(**json.loads((Path(folder) / PLAN).read_text()))


def make_keys(folder: Path, plan: Plan) -> None:
    """A signing key of each site, and where the link is secured a certificate of everybody."""
    for site in plan.sites():
        new_key(plan.key_file(site))
    if not plan.secured:
        return
    new_authority(folder, 2)
    named: list[tuple[Role, Sequence[str]]] = [(Role.SITE, plan.sites()), (Role.TRAIN, plan.train_ids()), (Role.ROUTER, [ROUTER])]
    for role, names in named:
        for name in names:
            new_certificate(folder, name, role, [], 1)
