from collections.abc import Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike, NDArray

from hybank._results import Geometry as Geometry, View as View

__all__ = ["Geometry", "View", "render"]

def render(
    images: Sequence[ArrayLike],
    *,
    disparity: Sequence[ArrayLike] | None = None,
    positions: Sequence[float] | NDArray[Any] | None = None,
    at: float | None = None,
    depth: Sequence[ArrayLike] | None = None,
    cameras: Sequence[ArrayLike] | None = None,
    camera: ArrayLike | None = None,
    tracks: ArrayLike | None = None,
    points: ArrayLike | None = None,
    size: tuple[int, int] | None = None,
    max_pixels: int = ...,
    offset: float = 0.0,
    nearest: int | None = None,
    method: Literal["auto", "rows", "plane"] = "auto",
    degree: Literal["cubic", "linear"] | None = None,
    lambda_: float | None = None,
    fill: Literal["background", "bridge", "leave"] = "background",
    drop_unknown: bool = False,
    keep_exposure: bool = False,
    seed: int | None = None,
    reverse_order: bool = False,
) -> View: ...
