"""The notebooks run from top to bottom and have the outputs that they show.

pytest python/tests/test_notebooks.py --write-notebooks    writes these outputs into the notebooks
"""

import re
from pathlib import Path

import pytest
from conftest import ROOT

import hybank as hb

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
NUMBER = r"[-+]?\d+\.\d+(?:e[-+]?\d+)?"


def test_there_are_three():
    assert len(NOTEBOOKS) == 3


def shown(cells):
    """What each cell of code shows: its texts, and the kinds of its outputs."""
    texts = []
    for cell in cells:
        if cell.cell_type != "code":
            continue
        outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
        text = "".join(output.get("text") or output.get("data", {}).get("text/plain", "") for output in outputs)
        kinds = [kind for output in outputs for kind in sorted(output.get("data", {"stream": 0}))]
        texts.append((text, kinds))
    return texts


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_has_its_outputs(path, tmp_path, monkeypatch, request):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    pytest.importorskip("matplotlib")
    # The kernel works in another folder.
    monkeypatch.setenv("PYTHONPATH", str(Path(hb.__file__).parents[1]))
    notebook = nbformat.read(path, as_version=4)
    stored = shown(notebook.cells)
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    for cell in notebook.cells:
        # Times of the run say nothing to a reader.
        cell.metadata.pop("execution", None)
    found = shown(notebook.cells)
    if request.config.getoption("--write-notebooks"):
        nbformat.write(notebook, path)
        return
    assert len(stored) == len(found) and any(text for text, _ in stored)
    for (want, want_kinds), (have, kinds) in zip(stored, found):
        assert want_kinds == kinds
        # The last digits belong to the processor, and pictures have an address in their text.
        words = lambda text: re.sub(r"<Figure .*?>", "", re.sub(NUMBER, "#", text))  # noqa: E731
        assert words(want) == words(have)
        numbers = [[float(number) for number in re.findall(NUMBER, text)] for text in (want, have)]
        assert numbers[1] == pytest.approx(numbers[0], rel=1e-4, abs=1e-9)
