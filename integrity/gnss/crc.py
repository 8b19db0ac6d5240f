"""CRC-24Q, which Galileo, SBAS and RTCM 3 share."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

CRC24Q_POLYNOMIAL = 0x1864CFB  # Galileo OS SIS ICD, 5.1.9.4; RTCA DO-229, A.4.3.3; RTCM 10403.3, 4.2
CRC24Q_BYTES = 3

LOOP_BYTES = 32  # up to here a loop over the bytes is faster
PIECE_BYTES = 1029  # the longest frame of RTCM 3


def _table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 16
        for _ in range(8):
            crc = crc << 1 ^ (CRC24Q_POLYNOMIAL if crc & 0x800000 else 0)
        table.append(crc)
    return tuple(table)


_TABLE = _table()


@cache
def _tables_from_end() -> NDArray[np.int32]:
    """What a byte adds to the CRC where so many bytes follow it, at index 256 times that number plus the byte; 1 MB."""
    one_more = np.array(_TABLE, dtype=np.int32)
    tables = np.empty((PIECE_BYTES, 256), dtype=np.int32)
    tables[0] = one_more
    for following in range(1, PIECE_BYTES):
        before = tables[following - 1]
        tables[following] = (before << 8 & 0xFFFFFF) ^ one_more[before >> 16]
    return tables.reshape(-1)


_ROWS = np.arange(PIECE_BYTES - 1, -1, -1, dtype=np.int32) * 256


def crc24q(data: bytes) -> int:
    """CRC-24Q, begun with zero: zeros in front of the data change nothing; of data with its CRC behind it, zero."""
    if len(data) <= LOOP_BYTES:
        crc = 0
        for byte in data:
            crc = crc << 8 & 0xFFFFFF ^ _TABLE[crc >> 16 ^ byte]
        return crc
    first = (len(data) - 1) % PIECE_BYTES + 1  # the odd piece goes first: nothing is carried into it
    crc = _crc_of_piece(data[:first])
    for begin in range(first, len(data), PIECE_BYTES):
        crc = _crc_of_piece(_carried_into(data[begin : begin + PIECE_BYTES], crc))
    return crc


def _crc_of_piece(piece: bytes) -> int:
    """The sum of what each byte adds: the CRC is linear."""
    places = _ROWS[PIECE_BYTES - len(piece) :] + np.frombuffer(piece, np.uint8)
    return int(np.bitwise_xor.reduce(_tables_from_end()[places]))


def _carried_into(piece: bytes, crc: int) -> bytes:
    """A piece whose own CRC is that of all data up to its end, the CRC before it being `crc`."""
    return (int.from_bytes(piece[:CRC24Q_BYTES], "big") ^ crc).to_bytes(CRC24Q_BYTES, "big") + piece[CRC24Q_BYTES:]
