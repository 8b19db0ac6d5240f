"""What the monitors of a station remember from epoch to epoch, all together: a part of its snapshot."""

from dataclasses import dataclass

from integrity.audit import AuditMemory, Ledger
from integrity.carrier_watch import CarrierMemory
from integrity.monitors.clocks import ClockMemory
from integrity.monitors.navigation import Served
from integrity.monitors.signal import GainMemory
from integrity.monitors.slow import SlowMemory

AUDITED_BESIDE_CIRCLES = 6  # common and shape, each also with height, residual, b_value: `audit.audited_checks`


def n_audited(n_receivers: int) -> int:
    """How many checks a station audits."""
    return n_receivers + AUDITED_BESIDE_CIRCLES


@dataclass(frozen=True, eq=False)
class MonitorMemory:
    """The sets that serve (`navigation`, one entry per satellite), receiver clocks, slow shifts, gains, the audit's ledgers, carriers."""

    navigation: tuple[Served, ...]
    clocks: ClockMemory
    slow: SlowMemory
    gains: GainMemory
    audit: AuditMemory
    carriers: CarrierMemory

    @staticmethod
    def empty(n_receivers: int, half_epochs: int) -> "MonitorMemory":
        """Before the first epoch; `half_epochs` of the windows of carriers."""
        return MonitorMemory(
            (),
            ClockMemory.empty(n_receivers),
            SlowMemory.empty(n_receivers),
            GainMemory.empty(n_receivers),
            AuditMemory((Ledger(),) * n_audited(n_receivers)),
            CarrierMemory.empty(n_receivers, half_epochs),
        )
