"""Everything that a localiser remembers, as values: another one that starts from it decides as the old one would have."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from integrity.assembler import AssemblerState
from integrity.gnss.ephemeris.broadcast import Ephemeris
from integrity.reception import ReceptionMemory
from train_client.localisation.coverage import Vouched
from train_client.localisation.fixes import FixMemory
from train_client.localisation.ground import GroundMemory
from train_client.localisation.progress import ProgressMemory
from train_client.outputs import Confirmed
from train_client.positioning.navigation import Told
from train_client.stop import Stop


@dataclass(frozen=True, eq=False)
class LocaliserMemory:
    """See the parts; by site what is remembered of each station. `here`: whose word counts where the train is, `confirmed_by`: and where a
    place was confirmed last (None: none was). Fixes that wait for confirmation are not kept."""

    reception: tuple[ReceptionMemory, ...] = ()
    told: tuple[Told, ...] = ()
    assembler: AssemblerState = field(default_factory=AssemblerState)
    ephemerides: tuple[Ephemeris, ...] = ()
    fixes: FixMemory = field(default_factory=FixMemory)
    progress: ProgressMemory = field(default_factory=ProgressMemory)
    grounds: Mapping[str, GroundMemory] = field(default_factory=dict)
    vouched: Mapping[str, tuple[Vouched, ...]] = field(default_factory=dict)
    here: tuple[str, ...] | None = None
    confirmed_by: tuple[str, ...] | None = None
    stop: Stop = field(default_factory=Stop)
    mono_ns: int | None = None
    sequence: int = 0
    confirmed: Confirmed | None = None
