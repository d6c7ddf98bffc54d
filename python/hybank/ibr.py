"""Image-based rendering: virtual views from views with depth, as arrays."""

import numpy as np

from hybank._hybank import HybankError, View, render_calibrated, render_rectified

__all__ = ["View", "render"]


def render(
    images,
    *,
    disparity=None,
    positions=None,
    at=None,
    depth=None,
    cameras=None,
    camera=None,
    size=None,
    method="auto",
    fill=True,
):
    """Render the view of a virtual camera.

    ``images`` are arrays (H, W) or (H, W, 3) with intensities 0 to 255. A rectified rig has a ``disparity`` map (H, W)
    per image, in pixels for a baseline of one, ``positions`` along the baseline, and renders the view ``at`` a position.
    Other rigs have a ``depth`` map per image, ``cameras`` (3, 4), and render the view of ``camera`` with ``size``
    (H, W), that of the first image unless given. NaN and 0 are unknown depth; ``fill=False`` leaves such pixels out.
    """
    images = [_image(image) for image in images]
    if disparity is not None and positions is not None and at is not None:
        maps = _maps(images, disparity, "disparity", positions, "positions")
        return render_rectified(images, maps, [float(p) for p in positions], float(at), method, fill)
    if depth is not None and cameras is not None and camera is not None:
        maps = _maps(images, depth, "depth", cameras, "cameras")
        size = images[0].shape[:2] if size is None else tuple(size)
        matrices = [np.ascontiguousarray(matrix, float) for matrix in cameras]
        return render_calibrated(images, maps, matrices, np.ascontiguousarray(camera, float), size, method, fill)
    raise HybankError("give disparity, positions and at of a rectified rig, or depth, cameras and camera of another one")


def _image(image):
    image = np.asarray(image)
    if image.ndim not in (2, 3):
        raise HybankError(f"an image has the shape (H, W) or (H, W, 3), not {image.shape}")
    return np.ascontiguousarray(image if image.ndim == 3 else image[:, :, None], np.float32)


def _maps(images, maps, name, others, other):
    maps = [np.ascontiguousarray(map_, np.float32) for map_ in maps]
    if not len(images) == len(maps) == len(others):
        raise HybankError(f"{len(images)} images need as many of {name} and {other}, not {len(maps)} and {len(others)}")
    return maps
