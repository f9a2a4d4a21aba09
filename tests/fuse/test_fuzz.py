"""Spoilt scan folders end in success or in one sentence that names the folder, and leave no partial output.

`python benchmarks/fuzz_scans.py` does the same hundreds of times, each able to crash or hang on its own.
"""

import pytest
from fuse import mutations

CASES = 30


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Good folders in every layout; those of clouds take long, and stay with the benchmark."""
    found = mutations.sources(tmp_path_factory.mktemp("sources"))
    return [folder for folder in found if not folder.name.startswith("cloud")]


@pytest.mark.filterwarnings("ignore:Truncated File Read", "ignore:.*DecompressionBomb")
@pytest.mark.parametrize("seed", range(CASES))
def test_spoilt(sources, tmp_path, seed):
    source = sources[seed % len(sources)]
    mutations.spoiled(source, tmp_path / "raw" / source.name, seed + 1000)
    mutations.outcome(tmp_path / "raw" / source.name, tmp_path / "out")


def test_the_good_ones_are_good(sources, tmp_path):
    for source in (sources[0], next(s for s in sources if s.name == "mesh_stl")):
        assert mutations.outcome(source, tmp_path / source.name) == "success"
