"""Physical constants of the broadcast models. A constant that differs between systems is named for its system."""

SPEED_OF_LIGHT_MPS = 299_792_458.0  # IS-GPS-200, 20.3.4.3; Galileo OS SIS ICD, 5.1.1
EARTH_ROTATION_RADPS = 7.2921151467e-5  # IS-GPS-200, table 20-IV; the same in Galileo OS SIS ICD, table 57
GPS_MU_M3PS2 = 3.986005e14  # IS-GPS-200, table 20-IV (WGS 84)
GALILEO_MU_M3PS2 = 3.986004418e14  # Galileo OS SIS ICD, table 57
GPS_RELATIVITY_SPSQRTM = -4.442807633e-10  # F = -2 sqrt(mu) / c^2, IS-GPS-200, 20.3.3.3.3.1
GALILEO_RELATIVITY_SPSQRTM = -4.442807309e-10  # F, Galileo OS SIS ICD, table 57
L1_HZ = 1_575.42e6  # GPS L1 and Galileo E1
