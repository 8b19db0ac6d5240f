"""Attacks on a train beside its station, real processes all: trust is never raised by one, and where it must end, it ends in time.

`python -m tests.e2e.attacks` prints what the train did. Each of these is one line of `tests.e2e.attacks.table`.
"""

from collections.abc import Iterator

import pytest

from tests.e2e.attacks.ride import Case, ride
from tests.e2e.attacks.scene import Scene
from tests.e2e.attacks.table import GROUPS, Group

ATTACKS = [pytest.param(group, case, id=case.name) for group in GROUPS for case in group.cases]


@pytest.fixture(scope="module")
def scene(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    """A station for all attacks of a group, or for those of them that this process of pytest does."""
    group: Group = request.param
    with group.scene(tmp_path_factory.mktemp("attacks")) as made:
        yield made


@pytest.mark.parametrize(("scene", "case"), ATTACKS, indirect=["scene"])
def test_a_train_under_attack_is_never_trusting_for_longer_than_it_may(scene: Scene, case: Case) -> None:
    assert ride(case, scene).wrong == ()
