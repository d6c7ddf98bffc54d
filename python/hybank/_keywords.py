"""Functions that answer a wrong keyword with the right one."""

import difflib
import functools
import inspect

from hybank._hybank import HybankError

# What a keyword of plain numbers counts.
_UNITS = {"drift": "parts per million", "offset": "full scale", "rate": "hertz"}


def refuse(function, unknown, known):
    """Raise the ``TypeError`` for keywords that a function does not have."""
    name = next(iter(unknown))
    near = difflib.get_close_matches(name, known, 1)
    advice = f"did you mean {near[0]!r}?" if near else f"it takes {', '.join(known) or 'none'}"
    raise TypeError(f"{function}() got an unexpected keyword argument {ascii(name)[:200]}; {advice}")


def keywords_of(*functions):
    """The names of the keywords of functions."""
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.VAR_KEYWORD)
    parameters = [one for each in functions for one in inspect.signature(each).parameters.values()]
    return [one.name for one in parameters if one.kind not in kinds and one.name != "self"]


def checked(function, others=()):
    """The same function, which names the nearest keyword for one that neither it nor the others have."""
    known = keywords_of(function, *others)
    shown = function.__qualname__.removesuffix(".__init__")

    @functools.wraps(function)
    def call(*arguments, **keywords):
        unknown = [name for name in keywords if name not in known]
        if unknown:
            refuse(shown, unknown, known)
        return function(*arguments, **keywords)

    return call


def need_numbers(**given):
    """Refuse texts where plain numbers are meant."""
    for keyword, values in given.items():
        for value in values if isinstance(values, (list, tuple)) else [values]:
            if isinstance(value, str):
                raise HybankError(f"{keyword}: {ascii(value)[:200]} is a text; give a number, in {_UNITS[keyword]}")


def check_methods(kind):
    """Let the public methods of a class of the extension module do the same, but for those that do it themselves."""
    for name, method in list(vars(kind).items()):
        if name.startswith("_") or name == "process" or not inspect.isroutine(method):
            continue
        is_static = isinstance(method, (staticmethod, type(len)))
        call = checked(getattr(kind, name))
        # Pickles of methods name it.
        call.__module__ = kind.__module__
        setattr(kind, name, staticmethod(call) if is_static else call)
