"""Banks and the binary that the tests compare with."""

import os
from pathlib import Path

import numpy as np
import pytest

import hybank as hb

ROOT = Path(__file__).resolve().parents[2]


def pytest_addoption(parser):
    """An option of the tests of notebooks."""
    parser.addoption("--write-notebooks", action="store_true", help="write outputs into the notebooks")


@pytest.fixture(scope="session")
def filters():
    """The folder of finished specs and banks."""
    return ROOT / "filters"


@pytest.fixture(scope="session")
def fir(filters):
    return hb.load(filters / "thesis-fir.json")


@pytest.fixture(scope="session")
def iir(filters):
    return hb.load(filters / "thesis-iir.json")


@pytest.fixture(scope="session")
def binary():
    """The command line program, named by HYBANK or built before."""
    folder = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    named = os.environ.get("HYBANK")
    candidates = [Path(named)] if named else [folder / profile / "hybank" for profile in ("release", "debug")]
    found = next((path for path in candidates if path.exists()), None)
    if found is None:
        pytest.skip("no hybank binary: cargo build, or name one with HYBANK")
    # Tests run it in other folders.
    return found.resolve()


@pytest.fixture
def random():
    return np.random.default_rng(7)
