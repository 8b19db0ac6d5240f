"""SBAS on L1 (MSAS, WAAS, EGNOS, GAGAN, KASS), by RTCA DO-229D.

What its messages are (`messages`, `contents`, `reading`), what has arrived (`store`, `grid`, `service`), what that makes of each satellite
(`corrections`, `ionosphere`), and how far off a position can then be (`protection`).
"""
