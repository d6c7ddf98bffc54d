"""Functions that answer a wrong keyword with the right one."""

import difflib
import functools
import inspect


def refuse(function, unknown, known):
    """Raise the ``TypeError`` for keywords that a function does not have."""
    name = next(iter(unknown))
    near = difflib.get_close_matches(name, known, 1)
    advice = f"did you mean {near[0]!r}?" if near else f"it takes {', '.join(known)}"
    raise TypeError(f"{function}() got an unexpected keyword argument {ascii(name)[:200]}; {advice}")


def refuse_of(kind, method, unknown):
    """The same for a method of a class."""
    known = [name for name in inspect.signature(getattr(kind, method)).parameters if name != "self"]
    refuse(f"{kind.__name__}.{method}", unknown, known)


def checked(function):
    """The same function, which names the nearest keyword for one that it does not have."""
    parameters = inspect.signature(function).parameters.values()
    known = [one.name for one in parameters if one.kind != one.POSITIONAL_ONLY and one.name != "self"]
    shown = function.__qualname__.removesuffix(".__init__")

    @functools.wraps(function)
    def call(*arguments, **keywords):
        unknown = [name for name in keywords if name not in known]
        if unknown:
            refuse(shown, unknown, known)
        return function(*arguments, **keywords)

    return call
