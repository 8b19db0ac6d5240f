"""What a number in a measurement can be. Outside of these bounds it is no measurement.

Each bound is far beyond what physics and receivers allow, and far inside what damage gives.
"""

from typing import Final

LAST_WEEK: Final = 4095  # June 2058
LEAST_RANGE_M: Final = 1.0e7  # satellites fly 19 thousand km and more above ground, and a receiver clock is off by 30 ms
# GPS, Galileo, GLONASS: up to 30 thousand km. At the horizon 42 for what is geostationary, 45 for the apogee of QZSS.
MOST_RANGE_M: Final = {"G": 4.0e7, "E": 4.0e7, "R": 4.0e7, "C": 5.5e7, "J": 5.5e7, "S": 5.5e7}
MOST_CARRIER_CYCLES: Final = 1.0e9  # 55 thousand km are 2.9e8; the rest is the oscillator since lock, 1 ppm over five days
MOST_DOPPLER_HZ: Final = 30_000.0  # 5 kHz of satellite and vehicle, 16 ppm of the oscillator
MOST_CN0_DBHZ: Final = 63.0  # six bits in the receiver
MOST_LOCK_S: Final = 64.5  # the counter stops there
