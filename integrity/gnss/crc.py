"""CRC-24Q, which Galileo, SBAS and RTCM 3 share."""

CRC24Q_POLYNOMIAL = 0x1864CFB  # Galileo OS SIS ICD, 5.1.9.4; RTCA DO-229, A.4.3.3; RTCM 10403.3, 4.2


def _table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 16
        for _ in range(8):
            crc = crc << 1 ^ (CRC24Q_POLYNOMIAL if crc & 0x800000 else 0)
        table.append(crc)
    return tuple(table)


_TABLE = _table()


def crc24q(data: bytes) -> int:
    """CRC-24Q, begun with zero: zeros in front of the data change nothing; of data with its CRC behind it, zero."""
    crc = 0
    for byte in data:
        crc = crc << 8 & 0xFFFFFF ^ _TABLE[crc >> 16 ^ byte]
    return crc
