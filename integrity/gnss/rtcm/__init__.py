"""RTCM 3, the protocol of reference stations: frames, measurements (MSM), ephemerides, the antenna's position."""
