"""Sine and cosine of whole arrays, faster than one by one."""

import numpy as np

from integrity.gnss.observations import Floats


def sine_cosine(angle_rad: Floats) -> tuple[Floats, Floats]:
    """Both from one tangent of half the angle, to 3e-16: numpy computes `tan` with vector instructions, `sin` and `cos` without."""
    t = np.tan(0.5 * angle_rad)
    square = t * t
    scale = 1.0 / (1.0 + square)
    return 2.0 * t * scale, (1.0 - square) * scale


def turned(sine: Floats, cosine: Floats, angle_rad: Floats) -> tuple[Floats, Floats]:
    """Sine and cosine of an angle that is larger by a small `angle_rad`, to 1e-15 for up to 0.02 rad, without trigonometry."""
    square = angle_rad * angle_rad
    sin_d = angle_rad * (1.0 - square / 6.0 * (1.0 - square / 20.0))
    cos_d = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0))
    return sine * cos_d + cosine * sin_d, cosine * cos_d - sine * sin_d
