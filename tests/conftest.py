"""What tests compare with: recordings of others, and RTKLIB. Without them the tests that need them are skipped, with the reason."""

from pathlib import Path
from types import ModuleType

import pytest

SHARED_DATA = Path(__file__).parents[1].parent / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    if not SHARED_DATA.is_dir():
        pytest.skip(f"no recordings at {SHARED_DATA}")
    return SHARED_DATA


@pytest.fixture(scope="session")
def rtklib() -> ModuleType:
    try:
        import pyrtklib5
    except ImportError as error:
        pytest.skip(f"pyrtklib5 cannot be imported: {error}")
    module: ModuleType = pyrtklib5
    return module
