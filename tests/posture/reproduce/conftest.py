"""Bootstrap intervals are computed once for the same values: made-up results repeat them."""

from collections.abc import Iterator, Sequence
from functools import cache

import pytest

from posture.analysis.statistics import bootstrap_mean
from posture.reproduce.claims import seed_means
from posture.reproduce.figures import seed_curves


@cache
def _bootstrap(values: tuple[float, ...]) -> tuple[float, float, float]:
    return bootstrap_mean(values)


@pytest.fixture(autouse=True, scope="package")
def _cached_bootstrap() -> Iterator[None]:
    def cached(values: Sequence[float]) -> tuple[float, float, float]:
        return _bootstrap(tuple(map(float, values)))

    with pytest.MonkeyPatch.context() as patch:
        for module in (seed_means, seed_curves):
            patch.setattr(module, "bootstrap_mean", cached)
        yield
