"""Views as arrays: a plane whose every view is known, for rectified and for general cameras."""

import numpy as np
import pytest

import hybank as hb

H, W = 24, 40


def texture(x, y):
    """Intensities on a plane that faces the cameras; smooth, so that interpolation hardly errs."""
    return 128 + 60 * np.sin(0.21 * x) + 40 * np.cos(0.17 * y + 0.05 * x)


def seen(shift):
    y, x = np.mgrid[:H, :W].astype(float)
    return texture(x + shift, y)


def test_a_plane_between_two_rectified_views():
    # A disparity of 4 pixels per baseline: the view at p shows the plane moved by 4 p.
    images, disparity = [seen(0.0), seen(4.0)], [np.full((H, W), 4.0)] * 2
    view = hb.ibr.render(images, disparity=disparity, positions=[0.0, 1.0], at=0.5)
    assert view.image.shape == view.depth.shape == view.mask.shape == (H, W)
    inner = np.s_[2:-2, 4:-4]
    assert np.abs(view.image - seen(2.0))[inner].max() < 0.5
    np.testing.assert_allclose(view.depth[inner], 4.0, atol=1e-5)
    assert (view.mask[inner] == 0).all() and view.coverage > 0.9
    colour = hb.ibr.render([np.dstack([i, i / 2, i]) for i in images], disparity=disparity, positions=[0, 1], at=0.5)
    assert colour.image.shape == (H, W, 3)
    np.testing.assert_allclose(colour.image[..., 0], view.image, atol=1e-3)


def test_a_plane_between_two_calibrated_cameras():
    k = np.array([[80.0, 0, 20], [0, 80, 12], [0, 0, 1]])
    camera = lambda x: k @ np.hstack([np.eye(3), [[-x], [0], [0]]])  # noqa: E731
    # At depth 10 a camera that is 0.5 to the right shows the plane moved by 80 * 0.5 / 10 = 4 pixels.
    images, depth = [seen(0.0), seen(4.0)], [np.full((H, W), 10.0)] * 2
    view = hb.ibr.render(images, depth=depth, cameras=[camera(0.0), camera(0.5)], camera=camera(0.25))
    inner = np.s_[3:-3, 5:-5]
    assert np.abs(view.image - seen(2.0))[inner].max() < 1.0
    np.testing.assert_allclose(view.depth[inner], 10.0, rtol=1e-4)
    small = hb.ibr.render(images, depth=depth, cameras=[camera(0), camera(0.5)], camera=camera(0), size=(10, 12))
    assert small.image.shape == (10, 12)


def test_what_does_not_fit_is_refused():
    image, map_ = np.zeros((H, W)), np.ones((H, W))
    rig = {"disparity": [map_], "positions": [0.0], "at": 0.0}
    for images, keywords, words in [
        ([image], {}, "give disparity, positions and at"),
        ([image, image], rig, "2 images need as many"),
        ([np.zeros(3)], rig, "shape"),
        ([image], {**rig, "disparity": [np.ones((3, 3))]}, "pixels"),
        ([image], {**rig, "method": "best"}, "choose"),
        ([image], {"depth": [map_], "cameras": [np.eye(3)], "camera": np.eye(3)}, r"\(3, 4\)"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.ibr.render(images, **keywords)
