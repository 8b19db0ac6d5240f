"""Ranges that cannot be told apart: where one of them is at fault, a position without any of them is as good as one without the faulty.

`detection` refuses to choose between residuals that say nearly the same, as those of a constellation's only two satellites do. Who can
spare all of them need not choose: what remains is tested again, and must have redundancy and geometry of its own.
"""

from typing import Any

import numpy as np

from integrity.gnss.detection import Checked, Criteria, Finding, detect_and_exclude
from integrity.gnss.least_squares import Design, Solution, design
from integrity.gnss.observations import Floats


def without_suspects(checked: Checked, of: Design, los_enu: Floats, residual_m: Floats, limits: Criteria) -> Checked:
    """What was found, but where it was AMBIGUOUS EXCLUDED without all suspects, if the rest passes the tests or does after exclusion.

    Arguments as `detect_and_exclude` had them.
    """
    unclear = checked.finding == Finding.AMBIGUOUS
    if not unclear.any():
        return checked
    kept = of.used & ~checked.suspects
    fewer = design(los_enu, of.sigma_m, kept, of.system_of, of.member.shape[1])
    again = detect_and_exclude(fewer, los_enu, residual_m, limits)
    good = unclear & ((again.finding == Finding.PASSED) | (again.finding == Finding.EXCLUDED))

    def better(name: str, of_found: bool = False) -> Any:
        new, old = (getattr(x.found if of_found else x, name) for x in (again, checked))
        return np.where(good.reshape(good.shape + (1,) * (new.ndim - 2)), new, old)

    return Checked(
        finding=np.where(good, Finding.EXCLUDED, checked.finding),
        excluded=np.where(good[..., None], again.excluded | checked.suspects, checked.excluded),
        suspects=checked.suspects & ~good[..., None],
        found=Solution(**{name: better(name, of_found=True) for name in Solution.__dataclass_fields__}),
        chi2=better("chi2"),
        dof=better("dof"),
        largest=better("largest"),
    )
