"""Which model of the ionosphere a receiver's files are solved with: the one that was asked for, or the first that they allow."""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

from integrity.errors import ConfigError
from integrity.gnss.atmosphere import Ionosphere
from integrity.gnss.combination import ionosphere_free
from integrity.gnss.observations import ObservationBlock
from integrity.gnss.signals import SECOND_CODES, Codes, first_codes_of
from recordings.rinex.navigation import NavigationFile
from recordings.solve.inputs import Heard, first_plausible

IONOSPHERES = ("klobuchar", "nequick", "free", "none")


class Model(NamedTuple):
    """A model of the ionosphere of IONOSPHERES, its terms, the codes that it is for, and, where nobody asked for it, why."""

    name: str
    terms: Ionosphere | None
    codes: Codes
    why: str | None


def model_of(
    asked: str | None, systems: tuple[str, ...], navigation: Sequence[NavigationFile], heard: Heard, first: ObservationBlock
) -> Model:
    """The ionosphere that was asked for, or the first that the files allow; ConfigError where they do not allow what was asked."""
    singles = first_codes_of(systems)
    pairs = {s: tuple(f"{one}+{two}" for one in singles[s] for two in SECOND_CODES[s]) for s in singles if s in SECOND_CODES}
    klobuchar = first_plausible(chain((file.klobuchar for file in navigation), (heard.klobuchar,)))
    galileo = next((file.galileo_ionosphere for file in navigation if file.galileo_ionosphere is not None), None)
    n_singles, n_pairs = _satellites(first, singles), _satellites(ionosphere_free(first), pairs)
    match asked:
        case "klobuchar" if klobuchar is None:
            raise ConfigError(_not_there("klobuchar", "Klobuchar terms (GPSA, GPSB, or ION ALPHA and BETA in RINEX 2)"))
        case "nequick" if galileo is None:
            raise ConfigError(_not_there("nequick", "coefficients of Galileo (GAL in IONOSPHERIC CORR, or ION records of RINEX 4)"))
        case "free" if not n_pairs:
            raise ConfigError(
                f"--ionosphere free: the first {len(first.epoch_ns)} epochs have no satellite of {', '.join(systems)} on two "
                "frequencies; use klobuchar, nequick or none"
            )
    name, why = asked, None
    if name is None:
        name, why = _first_allowed(klobuchar is not None, bool(n_pairs) and 2 * n_pairs >= n_singles)
    terms = {"klobuchar": klobuchar, "nequick": galileo}
    return Model(name, terms.get(name), pairs if name == "free" else singles, why)


def _first_allowed(has_klobuchar: bool, mostly_pairs: bool) -> tuple[str, str]:
    """A model where none was asked for, and why this one."""
    if has_klobuchar:
        return "klobuchar", "the navigation data have its terms"
    if mostly_pairs:
        return "free", "no Klobuchar terms, but a second frequency"
    return "none", "no Klobuchar terms, and no second frequency of most satellites"


def _not_there(model: str, terms: str) -> str:
    return (
        f"--ionosphere {model}: the navigation files have no {terms}; give one that has them with --nav, or another model: "
        f"{', '.join(name for name in IONOSPHERES if name != model)}"
    )


def _satellites(block: ObservationBlock, codes: Codes) -> int:
    """How many satellites of a block have one of these codes."""
    return len({s for s, signal in zip(block.satellites, block.signals, strict=True) if signal.partition(".")[2] in codes.get(s[0], ())})
