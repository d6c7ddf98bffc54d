"""Image-based rendering: virtual views from views with depth, as arrays."""

import operator

import numpy as np

from hybank._hybank import MOST_PIXELS, HybankError, render_calibrated, render_rectified, render_uncalibrated
from hybank._keywords import checked
from hybank._results import Geometry, View

__all__ = ["Geometry", "View", "render"]


@checked
def render(
    images,
    *,
    disparity=None,
    positions=None,
    at=None,
    depth=None,
    cameras=None,
    camera=None,
    tracks=None,
    points=None,
    size=None,
    max_pixels=MOST_PIXELS,
    offset=0.0,
    nearest=None,
    degree=None,
    fill="background",
    unknown="auto",
    keep_exposure=False,
    keep_cameras=False,
    seed=None,
):
    """Render the view of a virtual camera from views with depth.

    Maps may have outliers, noise and few known values: they are restored as by ``hybank-ibr render``.

    A rectified rig has `disparity`, `positions` and `at`; other cameras have `depth`, `cameras` and `camera`; views
    without cameras have `tracks`, and `points` or `at`.

    Parameters
    ----------
    images : list of array_like, (H, W) or (H, W, 3)
        Intensities 0 to 255.
    disparity : list of array_like (H, W), optional
        Pixels for a baseline of one; NaN and 0 are unknown.
    positions : list of float, optional
        Places along the baseline.
    at : float, optional
        The place that is rendered; of tracks 0 to 1 between the first two views.
    depth : list of array_like (H, W), optional
        NaN and 0 are unknown.
    cameras, camera : array_like (3, 4), optional
        The cameras of the images, and the virtual one.
    tracks : array_like (P, V, 2), optional
        x and y of P points in V images, NaN where a point is not seen.
    points : array_like (P, 2), optional
        The same points in the virtual camera.
    size : pair of int, optional
        (H, W) of the view; that of the first image if left out. A rectified rig has that of its images.
    max_pixels : int
        The most pixels that the view may have.
    offset : float
        Added to every column of the view, in pixels.
    nearest : int, optional
        Use only so many views, those nearest to the virtual camera.
    degree : {"cubic", "linear"}, optional
        Degree of the splines for general cameras; cubic if left out.
    fill : {"background", "bridge", "leave"}
        Continue the farther side into holes, bridge them by the spline, or leave them black.
    unknown : {"auto", "far", "fill", "drop"}
        What unknown depths are taken for: far away where they look like a sky and filled elsewhere, or all far away,
        filled from the farther neighbour, or left out.
    keep_exposure : bool
        Use the brightness of every image as it is, instead of giving all the exposure of the first.
    keep_cameras : bool
        Do not correct the cameras, or the rows of a rig, where the images do not fit each other.
    seed : int, optional
        Seed of the robust estimators for views without cameras; 1 if left out.

    Returns
    -------
    View

    Examples
    --------
    >>> column = np.arange(40.0) * np.ones((24, 1))
    >>> views = [128 + 60 * np.sin(0.2 * (column + shift)) for shift in (0, 4)]
    >>> view = hb.ibr.render(views, disparity=[np.full((24, 40), 4.0)] * 2, positions=[0, 1], at=0.5)
    >>> view.image.shape
    (24, 40)
    """
    images = [_image(image) for image in images]
    rectified = disparity is not None and positions is not None and at is not None
    calibrated = depth is not None and cameras is not None and camera is not None
    uncalibrated = tracks is not None and (points is None) != (at is None)
    if rectified + calibrated + uncalibrated != 1:
        raise HybankError(
            "give disparity, positions and at of a rectified rig, or depth, cameras and camera of another one, or tracks"
            " and either points or at of views without cameras"
        )
    for name, value, needs, has_use in [
        ("seed", seed, "views without cameras", uncalibrated),
        ("degree", degree, "views of general cameras", calibrated),
        ("nearest", nearest, "views with cameras", not uncalibrated),
    ]:
        if value is not None and not has_use:
            raise HybankError(f"{name}: it is for {needs}; leave it out of this rendering")
    options = {
        "fill": fill, "degree": degree, "offset": float(offset), "nearest": nearest, "keep_exposure": bool(keep_exposure),
        "keep_cameras": bool(keep_cameras),
    }
    size = _size(images, None if rectified else size, max_pixels)
    if rectified:
        maps = _maps(images, disparity, "disparity", positions, "positions")
        return render_rectified(images, maps, [float(p) for p in positions], float(at), options, unknown)
    if calibrated:
        maps = _maps(images, depth, "depth", cameras, "cameras")
        matrices = [_camera(matrix) for matrix in cameras]
        return render_calibrated(images, maps, matrices, _camera(camera), size, options, unknown)
    tracks, points = _tracks(tracks, points, len(images))
    at = 0.0 if at is None else float(at)
    return render_uncalibrated(images, tracks, points, at, size, options, seed)


def _size(images, size, most):
    if size is None and not images:
        return 0, 0
    height, width = images[0].shape[:2] if size is None else map(operator.index, size)
    if height < 1 or width < 1 or height * width > most:
        raise HybankError(f"size ({height}, {width}): a view has a pixel or more in each direction, {most} at most")
    return height, width


def _camera(matrix):
    matrix = _floats(matrix, float, "a camera")
    if matrix.shape != (3, 4):
        raise HybankError(f"a camera is a matrix of shape (3, 4), not {matrix.shape}")
    return matrix


def _tracks(tracks, points, views):
    tracks = _floats(tracks, float, "the array of tracks")
    if tracks.ndim != 3 or tracks.shape[1:] != (views, 2):
        raise HybankError(f"the tracks of {views} images have the shape (P, {views}, 2), not {tracks.shape}")
    if points is not None:
        points = _floats(points, float, "the array of points")
        if points.shape != (len(tracks), 2):
            raise HybankError(f"points has the shape ({len(tracks)}, 2) for {len(tracks)} tracks, not {points.shape}")
    if np.isinf(tracks).any() or (points is not None and np.isinf(points).any()):
        raise HybankError("a position of a point is infinite; NaN marks points that are not seen")
    return tracks, points


def _image(image):
    image = np.asarray(image)
    if image.ndim not in (2, 3) or image.shape[2:] not in ((), (1,), (3,)) or 0 in image.shape:
        raise HybankError(f"an image has the shape (H, W) or (H, W, 3), not {image.shape}")
    image = _floats(image if image.ndim == 3 else image[:, :, None], np.float32, "an image")
    if not np.isfinite(image).all():
        raise HybankError("an image has values that are not finite; intensities are numbers from 0 to 255")
    return image


def _maps(images, maps, name, others, other):
    maps = [_floats(map_, np.float32, f"a map of {name}") for map_ in maps]
    if not len(images) == len(maps) == len(others):
        raise HybankError(f"{len(images)} images need as many of {name} and {other}, not {len(maps)} and {len(others)}")
    for image, map_ in zip(images, maps, strict=True):
        if map_.shape != image.shape[:2]:
            raise HybankError(
                f"a map of {name} has the shape {map_.shape}; it needs the pixels of its image, {image.shape[:2]}"
            )
    return maps


def _floats(array, dtype, name):
    if np.iscomplexobj(array):
        raise HybankError(f"{name} is complex; give its real part")
    return np.ascontiguousarray(array, dtype)
