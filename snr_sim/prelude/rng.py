"""Random generators: each is derived only from the run's seed and the name of the component that uses it."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from snr_sim.prelude.errors import MissingExtraError

if TYPE_CHECKING:
    import numpy as np


def component_seed(seed: int) -> int:
    """Return the seed that the random generators of a run's components are derived from.

    It follows from the seed, but the seed does not follow from it: a component that is isolated from plant and devices,
    as in grading, gets this number and cannot compute other values that depend on the seed.
    """
    digest = hashlib.blake2b((seed % 2**64).to_bytes(8, "little"), digest_size=8, person=b"components").digest()
    return int.from_bytes(digest, "little")


def rng_for(seed: int, name: str) -> np.random.Generator:
    """Return the random generator that belongs to a name in a run.

    Two names never share a generator, so a component that draws once more does not change the numbers of others.

    >>> rng_for(7, "radar").random() == rng_for(7, "radar").random()
    True
    >>> rng_for(7, "radar").random() == rng_for(7, "inertial").random()
    False

    Raises:
        MissingExtraError: numpy is not installed.
    """
    try:
        import numpy as np  # slow to import, and most nodes need no random numbers
    except ImportError:
        raise MissingExtraError("numpy", "sim") from None

    digest = hashlib.blake2b(name.encode(), digest_size=16).digest()
    words = [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed % 2**64, *words])))
