"""Everything that a localiser remembers, as values: another one that starts from it decides as the old one would have."""

from dataclasses import dataclass, field

from integrity.assembler import AssemblerState
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.messages.verification import VerifierMemory
from integrity.reception import ReceptionMemory
from train_client.localisation.coverage import Vouched
from train_client.localisation.fixes import FixMemory
from train_client.localisation.progress import ProgressMemory
from train_client.outputs import Confirmed
from train_client.positioning.navigation import Told
from train_client.trust import Trust


@dataclass(frozen=True, eq=False)
class LocaliserMemory:
    """See the parts; `nonces` that were sent and when, `mono_ns` of the last event. Fixes that wait for confirmation are not kept."""

    reception: tuple[ReceptionMemory, ...] = ()
    told: tuple[Told, ...] = ()
    assembler: AssemblerState = field(default_factory=AssemblerState)
    ephemerides: tuple[Ephemeris, ...] = ()
    fixes: FixMemory = field(default_factory=FixMemory)
    progress: ProgressMemory = field(default_factory=ProgressMemory)
    vouched: tuple[Vouched, ...] = ()
    verifier: VerifierMemory = field(default_factory=VerifierMemory)
    trust: Trust = field(default_factory=Trust)
    nonces: tuple[tuple[bytes, int], ...] = ()
    challenge_at_ns: int | None = None
    mono_ns: int | None = None
    sequence: int = 0
    refused: int = 0
    confirmed: Confirmed | None = None
