"""What a user sees of the package: names, signatures, documentation with examples that run, pictures."""

import doctest
import inspect
import re
import shutil

import numpy as np
import pytest
from conftest import ROOT

import hybank as hb

FUNCTIONS = [getattr(hb, name) for name in hb.__all__ if inspect.isroutine(getattr(hb, name))]
FUNCTIONS += [hb.dask.fuse, hb.dask.sweep, hb.dask.warm_up, hb.ibr.render]
METHODS = [
    getattr(kind, name)
    for kind in (hb.Bank, hb.Stream, hb.Measurement, hb.Comparison, hb.Recording)
    for name in vars(kind)
    if not name.startswith("_") and inspect.isroutine(getattr(kind, name))
]


def named(thing):
    return getattr(thing, "__qualname__", repr(thing))


def test_the_module_shows_its_public_names():
    shown = dir(hb)
    assert set(hb.__all__) <= set(shown) and {"dask", "ibr", "gnuradio"} <= set(shown)
    assert not [name for name in shown if name.startswith("_") and name != "__version__"]


@pytest.mark.parametrize("thing", FUNCTIONS + METHODS, ids=named)
def test_the_documentation_is_whole_and_its_examples_run(thing, tmp_path, monkeypatch, filters):
    text = inspect.getdoc(thing)
    parameters = [name for name in inspect.signature(thing).parameters if name not in ("self", "/", "*")]
    if parameters:
        section = text[text.index("Parameters\n----------") :]
        for name in parameters:
            assert re.search(rf"^\**(.*, )?{name}(, .*)?( :|$)", section, re.M), name
    assert "Examples\n--------" in text
    monkeypatch.chdir(tmp_path)
    shutil.copy(filters / "thesis-fir.json", tmp_path)
    bank = hb.load("thesis-fir.json")
    names = {"hb": hb, "np": np, "bank": bank}
    test = doctest.DocTestParser().get_doctest(text, names, named(thing), None, 0)
    assert test.examples
    log = []
    failed, _ = doctest.DocTestRunner(verbose=False).run(test, out=log.append)
    assert not failed, "".join(log)


def test_a_wrong_keyword_is_answered_with_the_right_one(fir):
    for call, words in [
        (lambda: hb.design(fast_rat=48e3), "did you mean 'fast_rate'"),
        (lambda: hb.design(tabs=12), "did you mean 'taps'"),
        (lambda: hb.simulate(fir, "step@1", gian=2), "did you mean 'gain'"),
        (lambda: hb.measure(np.zeros(9), 1.0, interleave=2), "did you mean 'interleaved'"),
        (lambda: hb.analyze(fir, delaybox=1), "did you mean 'delay_box'"),
        (lambda: hb.butterworth(3, cutof=1), "did you mean 'cutoff'"),
        (lambda: hb.Channel(dealy=1), "did you mean 'delay'"),
        (lambda: fir.fuse(np.zeros((2, 4)), gabs=True), "did you mean 'gaps'"),
        (lambda: fir.stream(algoritm="direct"), "did you mean 'algorithm'"),
        (lambda: fir.export("x", format="c", nome="y"), "did you mean 'name'"),
        (lambda: hb.verify(fir, zzz=1), "it takes bank, search"),
    ]:
        with pytest.raises(TypeError, match=words):
            call()


@pytest.mark.parametrize("thing", [*FUNCTIONS, *METHODS, hb.Channel, hb.Signal, hb.Recording, hb.Captures.mono], ids=named)
def test_every_function_answers_a_keyword_that_it_does_not_have(thing, fir):
    # What Python itself looks for first.
    first = {hb.dask.sweep: ([],), hb.Stream.process: (fir.stream(), np.zeros((2, 1))), hb.Recording: ("x.wav",)}
    given = first.get(thing, ())
    with pytest.raises(TypeError, match=r"unexpected keyword argument 'zzz'; (did you mean|it takes) ") as caught:
        thing(*given, zzz=1)
    # The name that a user wrote.
    assert str(caught.value).startswith(f"{thing.__qualname__}()")


def test_methods_of_the_extension_module_stay_what_they_are(fir):
    import copy
    import pickle

    assert pickle.loads(pickle.dumps(fir.fuse))(np.zeros((2, 3))).shape == (6,)
    assert copy.copy(fir) is fir and pickle.loads(pickle.dumps(fir)) == fir
    assert hb.Bank.from_json(fir.to_json()) == fir == fir.from_json(fir.to_json())
    for method in METHODS:
        assert inspect.getdoc(method) and getattr(method, "__module__", "hybank").split(".")[0] == "hybank", method


def test_the_block_of_gnu_radio_is_documented():
    """By its source: GNU Radio is not there."""
    import ast

    tree = ast.parse((ROOT / "python" / "hybank" / "gnuradio.py").read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.ClassDef)]
    (init,) = [node for node in block.body if getattr(node, "name", "") == "__init__"]
    text = ast.get_docstring(block)
    section = text[text.index("Parameters\n----------") :]
    for name in [one.arg for one in init.args.args if one.arg != "self"]:
        assert re.search(rf"^{name} : ", section, re.M), name
    assert "Examples\n--------" in text and [mark.id for mark in init.decorator_list] == ["checked"]


def test_the_signature_of_design_has_the_keys_of_a_spec():
    from hybank import _spec

    names = inspect.signature(hb.design).parameters
    assert {"fast_rate", "ratio", "latency", "channels", "target", "signal", "uncertainty"} <= set(names)
    assert set(_spec._DESIGN_KEYS) <= set(names)
    stub = (ROOT / "python" / "hybank" / "__init__.pyi").read_text()
    stubbed = stub[stub.index("source: None = None") : stub.index("def import_taps")]
    for name in names:
        assert f"    {name}: " in stubbed or name in ("source", "replace"), name


def test_signatures_and_stubs_agree():
    """The same parameters with the same defaults, for every function."""
    import ast

    tree = ast.parse((ROOT / "python" / "hybank" / "__init__.pyi").read_text())
    functions = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name != "design"]
    classes = {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
    methods = [(getattr(hb, kind), node) for kind in ("Bank", "Stream") for node in classes[kind].body]
    checked = 0
    for owner, node in [(hb, node) for node in functions] + methods:
        if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
            continue
        if any(getattr(mark, "id", getattr(mark, "attr", "")) == "property" for mark in node.decorator_list):
            continue
        real = inspect.signature(getattr(owner, node.name)).parameters
        given = [a.arg for a in node.args.posonlyargs + node.args.args + node.args.kwonlyargs if a.arg != "self"]
        given += [node.args.vararg.arg] if node.args.vararg else []
        assert given == [name for name in real if name != "self"], node.name
        checked += 1
    assert checked > 30


def test_a_picture_of_a_bank_has_labels_that_do_not_collide(fir):
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    figure, ax = plt.subplots()
    fir.plot(ax)
    # Upper and lower bound agree in six digits: as texts in the picture they would cover one another.
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(labels) == 4 == len(set(labels)) and not ax.texts
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in ax.get_legend().get_texts()]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    for name in fir.pictures():
        other = fir.plot(plt.subplots()[1], picture=name)
        assert other.lines
    with pytest.raises(hb.HybankError, match="picture: 'errors' is unknown"):
        fir.plot(ax, picture="errors")
    plt.close("all")


def test_a_measurement_shows_itself():
    n = np.arange(8192)
    m = hb.measure(0.5 * np.cos(0.3 * n) + 1e-3 * np.cos(0.6 * n) + 1e-4 * np.cos(2.2 * n), 48e3)
    page = m._repr_html_()
    for words in ("<table>", "SINAD", f"{m.sinad_db:.2f}", "ENOB", "THD", "dBc"):
        assert words in page
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    ax = m.plot()
    frequency, level = m.spectrum
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), level)
    assert len(ax.get_legend().get_texts()) == len({text.get_text() for text in ax.get_legend().get_texts()}) > 1
    hb.measure(np.cos(0.3 * n), 48e3, ref=0.5 * np.cos(0.3 * n)).plot(ax)
    plt.close("all")
