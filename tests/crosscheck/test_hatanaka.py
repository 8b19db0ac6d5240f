"""Our expansion of Compact RINEX against that of CRX2RNX, byte by byte, on a recorded file and on what RNX2CRX makes of others."""

import gzip
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from integrity.gnss.observations import same_measurements
from recordings.rinex.hatanaka import expanded
from recordings.rinex.observation import read_observations
from recordings.rinex.pieces import read_pieces
from tests.rinex_text import observation_text
from tests.unit.imported import ROWS

hatanaka: Any = pytest.importorskip("hatanaka")

FILES = [
    "catalonia_2010/CREU0770_00-12h.10o.gz",
    "catalonia_2010/MATA0770_00-12h.10o.gz",
    "catalonia_2010/UPC10770.11o.gz",
    "gsi_2005/07590920.05o.gz",
    "nagoya_static/base.obs.gz",
    "rosalia_2025/ROSR01TUW_R_20250010600_15M_05S_AA.rnx.gz",
    "sbas_2025/kama_046r.obs.gz",
    "spp_truth/SEPT078M.21O.gz",
    "tokyo_sbas_2008/cres_20080526.obs.gz",
    "tokyo_sbas_2008/oemv_200911218.obs.gz",
]


def expansion(path: Path) -> tuple[bytes, dict[str, int]]:
    problems: Counter[str] = Counter()
    return b"".join(expanded(str(path), read_pieces(path, problems), problems)), dict(problems)


def test_a_day_of_all_systems(shared_data: Path) -> None:
    path = shared_data / "spp_truth" / "ESBC00DNK_2020177.crx.gz"
    text, problems = expansion(path)
    assert problems == {}
    assert text == hatanaka.crx2rnx(gzip.decompress(path.read_bytes()))


@pytest.mark.parametrize("name", FILES)
def test_recordings_compressed_by_rnx2crx(shared_data: Path, tmp_path: Path, name: str) -> None:
    compact = hatanaka.rnx2crx(gzip.decompress((shared_data / name).read_bytes()))
    path = tmp_path / "compact.crx"
    path.write_bytes(compact)
    text, problems = expansion(path)
    assert problems == {}
    assert text == hatanaka.crx2rnx(compact)


def test_a_file_that_begins_again_every_few_epochs(shared_data: Path, tmp_path: Path) -> None:
    compact = hatanaka.rnx2crx(gzip.decompress((shared_data / "nagoya_static" / "base.obs.gz").read_bytes()), reinit_every_nth=7)
    path = tmp_path / "compact.crx"
    path.write_bytes(compact)
    assert expansion(path) == (hatanaka.crx2rnx(compact), {})


@pytest.mark.parametrize("every", [None, 3])
def test_rows_from_compact_rinex_are_those_from_rinex(tmp_path: Path, every: int | None) -> None:
    plain, compact = tmp_path / "plain.rnx", tmp_path / "compact.crx.gz"
    plain.write_text(observation_text(ROWS["A"]), "ascii")
    compact.write_bytes(gzip.compress(hatanaka.rnx2crx(plain.read_bytes(), reinit_every_nth=every)))
    ours, expected = read_observations(compact, "A"), read_observations(plain, "A")
    assert ours.problems == {}
    assert [same_measurements(a, b) for a, b in zip(ours.rows, expected.rows, strict=True)] == [True] * len(ROWS["A"])


CLOCKS = """\
     2.11           OBSERVATION DATA    M (MIXED)           RINEX VERSION / TYPE
     6    C1    L1    P2    L2    S1    S2                  # / TYPES OF OBSERV
                                                            END OF HEADER
"""


def test_clock_offsets_small_numbers_and_events_of_rinex2(tmp_path: Path) -> None:
    text = CLOCKS
    for k, (clock, number) in enumerate(
        [("  .000000012", 0.001), (" -.123456789", -0.021), (" 1.500000000", 12.345), ("", -0.5), ("-1.000000001", -1.0)]
    ):
        names = [f"G{n:2d}" for n in range(1 + k, 15 + k)]
        text += f" 20  6 25  0  0 {k:2d}.0000000  0 14{''.join(names[:12])}{clock}\n{'':32}{''.join(names[12:])}\n"
        for n in range(14):
            fields = [
                f"{number * (n + 1):14.3f}{n % 8} ",
                f"{-1e8 - 1234.5 * k * k:14.3f} {k}",
                " " * 16 if (n + k) % 3 else f"{2e7 + k:14.3f}  ",
            ]
            text += "".join(fields).rstrip() + "\n" + f"{40 + k:14.3f}" + "\n"
        if k == 2:
            text += f"{'':28}4  2\n{'a comment':<60}COMMENT\n{'     6    C1    L1    P2    L2    S1    S2':<60}# / TYPES OF OBSERV\n"
    compact = hatanaka.rnx2crx(text.encode())
    path = tmp_path / "compact.crx"
    path.write_bytes(compact)
    assert expansion(path) == (hatanaka.crx2rnx(compact), {})
