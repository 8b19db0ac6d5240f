"""What a command line asks `wayside solve` for."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from integrity.errors import ConfigError
from integrity.gnss.signals import SYSTEM_NAMES
from recordings.ground_point import ground_point_ecef_m
from recordings.rinex.navigation import NavigationFile, read_navigation
from recordings.solve.ionosphere import IONOSPHERES

HIGHEST_MASK_DEG = 45.0  # as of a site file
FALSE_ALARM = 1e-5  # an epoch: of 1 Hz, one in 28 hours where the sigmas are right, and they are no smaller than errors in the open are
FALSE_ALARMS = (1e-12, 0.01)
WINDOWS_S = (1.0, 3600.0)


@dataclass(frozen=True)
class Request:
    """What to solve: files of one receiver, `systems` by name, `ionosphere` of IONOSPHERES or None for what the files allow.

    `false_alarm` of the tests, None: nothing is tested, nor excluded. `smooth_s`: window of the carrier's smoothing, None: none.
    """

    observations: tuple[Path, ...]
    navigation: tuple[NavigationFile, ...]
    systems: tuple[str, ...]
    ionosphere: str | None
    mask_deg: float
    true_pos_ecef_m: tuple[float, float, float] | None
    false_alarm: float | None
    velocity: bool
    smooth_s: float | None
    residuals: Path | None


def request_of(
    observations: Sequence[Path],
    nav: Sequence[Path],
    systems: str,
    ionosphere: str | None,
    mask_deg: float,
    position: str | None,
    exclude: bool,
    false_alarm: float | None,
    velocity: bool,
    smooth_s: float | None,
    output: Path | None,
    residuals: Path | None,
) -> Request:
    """From the words of a command line; ConfigError for one that is wrong, DecodeError and OSError for navigation files."""
    if ionosphere is not None and ionosphere not in IONOSPHERES:
        raise ConfigError(f"--ionosphere {ionosphere!r}: expected one of {', '.join(IONOSPHERES)}")
    if not 0.0 <= mask_deg <= HIGHEST_MASK_DEG:
        raise ConfigError(f"--mask {mask_deg:g}: expected 0 to {HIGHEST_MASK_DEG:g} degrees")
    if smooth_s is not None and not WINDOWS_S[0] <= smooth_s <= WINDOWS_S[1]:
        raise ConfigError(f"--smooth {smooth_s:g}: expected {WINDOWS_S[0]:g} to {WINDOWS_S[1]:g} seconds, such as 100")
    if residuals is not None and output is not None and residuals.absolute() == output.absolute():
        raise ConfigError(f"--residuals {residuals}: that is the file of -o; give each a name of its own")
    for option, path in (("-o", output), ("--residuals", residuals)):
        if path is not None and any(path.absolute() == read.absolute() for read in (*observations, *nav)):
            raise ConfigError(f"{option} {path}: that is one of the files to read; give another name")
    chosen = _systems(systems)
    false_alarm = _false_alarm(exclude, false_alarm)
    true_pos_ecef_m = None if position is None else ground_point_ecef_m(position)
    navigation = tuple(read_navigation(path) for path in nav)
    return Request(
        tuple(observations), navigation, chosen, ionosphere, mask_deg, true_pos_ecef_m, false_alarm, velocity, smooth_s, residuals
    )


def _false_alarm(exclude: bool, asked: float | None) -> float | None:
    if asked is not None and not exclude:
        raise ConfigError(f"--false-alarm {asked:g} with --no-exclude: nothing is tested then; leave one of the two out")
    if asked is not None and not FALSE_ALARMS[0] <= asked <= FALSE_ALARMS[1]:
        low, high = FALSE_ALARMS
        raise ConfigError(f"--false-alarm {asked:g}: expected a probability of {low:g} to {high:g} per epoch, such as {FALSE_ALARM:g}")
    return (FALSE_ALARM if asked is None else asked) if exclude else None


def _systems(text: str) -> tuple[str, ...]:
    name_of = {name.lower(): name for name in SYSTEM_NAMES.values()}
    asked = [part.strip().lower() for part in text.split(",")]
    if not set(asked) <= name_of.keys():
        raise ConfigError(f"--systems {text!r}: expected names among {', '.join(name_of.values())}, with commas between them")
    return tuple(name for key, name in name_of.items() if key in asked)
