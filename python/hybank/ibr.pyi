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
    degree: Literal["cubic", "linear"] | None = None,
    fill: Literal["background", "bridge", "leave"] = "background",
    unknown: Literal["auto", "far", "fill", "drop"] = "auto",
    keep_exposure: bool = False,
    keep_cameras: bool = False,
    seed: int | None = None,
) -> View: ...
