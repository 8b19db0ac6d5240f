"""What a train decides with: the values of its file that matter to decisions. No I/O; the file is read by `train_client.train_file`."""

from dataclasses import dataclass

from integrity.config import Protocol
from train_client.stop import StopLimits
from train_client.trust import TrustLimits


@dataclass(frozen=True)
class AntennaConfig:
    """One antenna: `x_m` from the front end, backwards negative; `y_m` right of the track centre; `height_m` above railhead.

    `protocol` of its receiver's bytes.
    """

    id: str
    x_m: float
    y_m: float
    height_m: float
    protocol: Protocol = "ubx"


@dataclass(frozen=True)
class TrainConfig:
    """A train. `facing`: front end towards increasing (1) or decreasing (-1) offsets of the map; 0: as the antennas say.

    Range sigmas, m: a single range has sqrt(a^2 + (b / sin el)^2) with a, b as here, times URA / 2.4 m where the broadcast promises less;
    a pair of two frequencies has sigmas of its own.
    """

    train_id: str
    length_m: float
    antennas: tuple[AntennaConfig, ...]
    epoch_interval_ns: int
    facing: int
    most_speed_mps: float
    sigma_range_m: float
    sigma_range_low_m: float
    sigma_range_pair_m: float
    sigma_range_pair_low_m: float
    stations: tuple[str, ...]
    max_valid_ms: int
    trust: TrustLimits
    stop: StopLimits
    config_sha256: str

    @property
    def antenna_ids(self) -> tuple[str, ...]:
        """In the order of the file."""
        return tuple(antenna.id for antenna in self.antennas)

    @property
    def protocols(self) -> dict[str, Protocol]:
        """Of the receivers' bytes, by antenna."""
        return {antenna.id: antenna.protocol for antenna in self.antennas}
