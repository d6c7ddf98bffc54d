from collections.abc import Sequence
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["View", "render"]

@final
class View:
    @property
    def image(self) -> NDArray[np.float32]: ...
    @property
    def depth(self) -> NDArray[np.float32]: ...
    @property
    def mask(self) -> NDArray[np.uint8]: ...
    @property
    def coverage(self) -> float: ...

def render(
    images: Sequence[ArrayLike],
    *,
    disparity: Sequence[ArrayLike] | None = None,
    positions: Sequence[float] | NDArray[Any] | None = None,
    at: float | None = None,
    depth: Sequence[ArrayLike] | None = None,
    cameras: Sequence[ArrayLike] | None = None,
    camera: ArrayLike | None = None,
    size: tuple[int, int] | None = None,
    method: Literal["auto", "rows", "plane"] = "auto",
    fill: bool = True,
) -> View: ...
