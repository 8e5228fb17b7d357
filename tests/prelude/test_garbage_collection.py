import gc
from collections.abc import Iterator

import pytest

from snr_sim.prelude.values import no_garbage_collection


@pytest.fixture(params=[True, False])
def was_enabled(request: pytest.FixtureRequest) -> Iterator[bool]:
    """Whether garbage is collected before; it is again after the test."""
    (gc.enable if request.param else gc.disable)()
    yield request.param
    gc.enable()


def test_no_garbage_collection_restores_state_also_after_error(was_enabled: bool) -> None:
    with no_garbage_collection():
        assert not gc.isenabled()
    assert gc.isenabled() == was_enabled
    with pytest.raises(ValueError, match="damaged"), no_garbage_collection():
        raise ValueError("damaged")
    assert gc.isenabled() == was_enabled
