from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, Literal, TypeAlias

from numpy.typing import DTypeLike

from hybank import Bank

_Path: TypeAlias = str | PathLike[str]
_Source: TypeAlias = _Path | tuple[_Path, str] | Sequence[_Path]
_Algorithm: TypeAlias = Literal["auto", "direct", "overlap-save"]
_Progress: TypeAlias = Callable[[int, int], object]

SPAN: int

@dataclass
class Report:
    algorithm: str
    frames: int
    spans: int
    warm_up: int
    replaced: int = 0
    clipped: int = 0
    reruns: list[int] = field(default_factory=list)

def fuse(
    bank: Bank,
    source: _Source,
    sink: _Path,
    *,
    client: Any = None,
    axis: int = -1,
    dtype: DTypeLike | None = None,
    algorithm: _Algorithm = "auto",
    span: int | None = None,
    progress: _Progress | None = None,
) -> Report: ...
def sweep(
    specs: Iterable[_Path | Mapping[str, Any]],
    *,
    map: Callable[..., Iterable[Any]] = ...,
    client: Any = None,
    progress: _Progress | None = None,
    **keywords: Any,
) -> list[Bank | Exception]: ...
def warm_up(bank: Bank) -> int: ...
