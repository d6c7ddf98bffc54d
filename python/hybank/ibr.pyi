from collections.abc import Sequence
from typing import Any, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Geometry", "View", "render"]

@final
class Geometry:
    @property
    def matches(self) -> int: ...
    @property
    def inliers(self) -> int: ...
    @property
    def sampson_rms(self) -> float: ...
    @property
    def sightings(self) -> int: ...
    @property
    def resection_inliers(self) -> int: ...
    @property
    def resection_rms(self) -> float: ...
    @property
    def order_agreement(self) -> float: ...
    @property
    def order_by(self) -> Literal["given", "calibrations", "colours", "both", "nothing"]: ...

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
    @property
    def region(self) -> NDArray[np.bool_]: ...
    @property
    def geometry(self) -> Geometry | None: ...

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
    method: Literal["auto", "rows", "plane"] = "auto",
    fill: bool = True,
    reverse_order: bool = False,
) -> View: ...
