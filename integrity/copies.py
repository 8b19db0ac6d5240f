"""Copies of an epoch, one below the other in a block of their own: for shadow faults."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from integrity.gnss.ephemeris.states import SatelliteStates
from integrity.gnss.observations import Floats, ObservationBlock
from integrity.gnss.positioning import Prefit
from integrity.sight import Sight


def copies_of(sight: Sight, e: int, more_m: Floats) -> Sight:
    """Epoch e as often as residuals (n, R, S) are added to its own."""
    n, sky, at = len(more_m), sight.sky, sight.at_points
    states, seen = sky.states, sky.expected
    residual_m = at.residual_m[e] + more_m
    los_enu = np.repeat(at.los_enu[:, e : e + 1], n, axis=1)

    def repeated(of: Any, axis: int = 0) -> Any:
        return of.take([e if of.shape[axis] > 1 else 0] * n, axis=axis)  # what is the same in all epochs may stand there once

    states = SatelliteStates(**{f.name: repeated(of := getattr(states, f.name), int(of.ndim == 3)) for f in fields(states)})
    seen = seen._replace(los_enu=los_enu, **{name: repeated(getattr(seen, name)) for name in seen._fields if name != "los_enu"})
    copied = replace(
        sky,
        index=repeated(sky.index),
        in_view=repeated(sky.in_view),
        states=states,
        expected=seen,
        sigma_m=repeated(sky.sigma_m),
        sigma_differential_m=repeated(sky.sigma_differential_m),
    )
    inputs = sight.satellites._replace(
        prefit_m=residual_m,
        los_enu=los_enu,
        sigma_m=copied.sigma_m,
        sigma_differential_m=copied.sigma_differential_m,
        screened=repeated(sight.satellites.screened),
        watched=(),
    )
    shown = Prefit(residual_m, los_enu, seen.el_rad, seen.az_rad)
    return replace(sight, block=repeated_block(sight.block, e, n), sky=copied, at_points=shown, satellites=inputs)


def repeated_block(block: ObservationBlock, e: int, n: int) -> ObservationBlock:
    """Epoch e of a block, n times."""
    alike = ("receivers", "signals", "satellites")
    arrays: dict[str, Any] = {f.name: np.repeat(getattr(block, f.name)[e : e + 1], n, axis=0) for f in fields(block) if f.name not in alike}
    return replace(block, **arrays)
