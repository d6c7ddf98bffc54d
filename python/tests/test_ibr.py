"""Views as arrays: scenes whose every view is known, for rectified, general and unknown cameras."""

import subprocess

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


def test_what_seems_to_be_wrong_is_a_warning():
    images, disparity = [seen(0.0), seen(4.0)], [np.full((H, W), 4.0)] * 2
    for maps, positions, words in [
        (disparity, [1.0, 0.0], "seem to be exchanged"),
        ([4 * map_ for map_ in disparity], [0.0, 1.0], "disparities seem to be 4 times too large"),
    ]:
        with pytest.warns(UserWarning) as caught:
            hb.ibr.render(images, disparity=maps, positions=positions, at=0.5)
        assert any(words in str(warning.message) for warning in caught), [str(w.message) for w in caught]


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


NEAR, FAR = 4.0, 8.0
SIZE = (120, 160)


class Square:
    """A near square before a far wall, and a camera that sees it."""

    def __init__(self, x, turn):
        cos, sin = np.cos(turn), np.sin(turn)
        self.rotation = np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]])
        self.centre = np.array([x, 0.2 * x, 0.0])
        self.intrinsic = np.array([[150.0, 0, 79.5], [0, 150, 59.5], [0, 0, 1]])

    def seen(self, x, y):
        """Brightness and whether the square is seen, at pixels."""
        ray = np.linalg.solve(self.intrinsic @ self.rotation, np.stack([x, y, np.ones_like(x)]).reshape(3, -1))
        at = lambda z: self.centre[:, None] + ray * ((z - self.centre[2]) / ray[2])  # noqa: E731
        near, far = at(NEAR), at(FAR)
        square = (np.abs(near[0]) <= 0.6) & (np.abs(near[1]) <= 0.5)
        front = 200 + 30 * np.sin(9 * near[0]) * np.cos(8 * near[1])
        wall = 80 + 40 * np.sin(4 * far[0]) * np.cos(5 * far[1] + far[0])
        return np.where(square, front, wall).reshape(x.shape), square.reshape(x.shape)

    def image(self):
        y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
        return self.seen(x, y)[0]

    def matrix(self):
        return self.intrinsic @ self.rotation @ np.hstack([np.eye(3), -self.centre[:, None]])

    def depth(self):
        """Depths along the axis: rays of depth one reach the planes after that many of their own lengths."""
        y, x = np.mgrid[: SIZE[0], : SIZE[1]].astype(float)
        ray = np.linalg.solve(self.intrinsic @ self.rotation, np.stack([x, y, np.ones_like(x)]).reshape(3, -1))
        plane = np.where(self.seen(x, y)[1].ravel(), NEAR, FAR)
        return ((plane - self.centre[2]) / ray[2]).reshape(x.shape)

    def positions(self, points):
        """Positions of points (P, 3), NaN where they are hidden or outside."""
        p = (points - self.centre) @ (self.intrinsic @ self.rotation).T
        x, y = p[:, 0] / p[:, 2], p[:, 1] / p[:, 2]
        outside = (x < 0) | (y < 0) | (x > SIZE[1] - 1) | (y > SIZE[0] - 1)
        hidden = (points[:, 2] == FAR) & self.seen(x, y)[1]
        return np.where((outside | hidden)[:, None], np.nan, np.stack([x, y], 1))


def grid(count, width, height, z):
    x, y = np.meshgrid(np.linspace(-width, width, count), np.linspace(-height, height, count))
    return np.stack([x.ravel(), y.ravel(), np.full(count**2, z)], 1)


@pytest.fixture(scope="module")
def square():
    """Images and tracks of two cameras, and image and positions of a third one between them."""
    cameras = [Square(-0.5, 0.02), Square(0.5, -0.03), Square(0.05, 0.0)]
    points = np.concatenate([grid(17, 0.6, 0.5, NEAR), grid(41, 4.2, 3.1, FAR)])
    tracks = np.stack([camera.positions(points) for camera in cameras], 1)
    images = [camera.image() for camera in cameras]
    return images[:2], tracks[:, :2], images[2], tracks[:, 2]


def test_views_without_cameras(square):
    images, tracks, truth, points = square
    view = hb.ibr.render(images, tracks=tracks, points=points)
    error = lambda view: np.sqrt(np.mean((view.image - truth)[view.region] ** 2))  # noqa: E731
    assert view.image.shape == view.region.shape == SIZE and view.region.dtype == bool
    assert view.region.mean() > 0.7 and error(view) < 12
    assert (view.image[~view.region] == 0).all()
    found = view.geometry
    assert found.matches == np.isfinite(tracks).all((1, 2)).sum() >= found.inliers > 0.99 * found.matches
    assert found.sampson_rms < 0.01 and found.resection_rms < 0.01
    assert found.order_by in ("calibrations", "colours", "both") and 0.5 < found.order_agreement <= 1
    # Colours, another size, and a camera between the two.
    colour = hb.ibr.render([np.dstack([i, i / 2, i]) for i in images], tracks=tracks, at=0.5, size=(60, 80))
    assert colour.image.shape == (60, 80, 3) and colour.region.any()
    np.testing.assert_allclose(colour.image[..., 1], colour.image[..., 0] / 2, atol=0.5)


def test_an_undecided_order_of_depth_is_a_warning():
    """A surface of one colour, nearly flat, from positions with noise: nothing shows which points are nearer."""
    random = np.random.default_rng(2)
    points = random.uniform((-2, -1.5, 7.7), (2, 1.5, 8.3), (150, 3))
    tracks = np.stack([Square(-0.5, 0.02).positions(points), Square(0.5, -0.03).positions(points)], 1)
    tracks += 0.3 * random.standard_normal(tracks.shape)
    with pytest.warns(UserWarning, match="order of depth is undecided") as caught:
        view = hb.ibr.render([np.full(SIZE, 9.0)] * 2, tracks=tracks, points=tracks[:, 0])
    assert caught[0].filename == __file__ and view.geometry.order_by == "nothing"


@pytest.fixture(scope="module")
def ibr(binary):
    """The program hybank-ibr, beside the other one."""
    found = binary.with_name(f"hybank-ibr{binary.suffix}")
    if not found.exists():
        pytest.skip("no hybank-ibr binary: cargo build")
    return found


def by_the_program(ibr, folder, images, name, maps, keys, virtual):
    """The view that the program renders of the same arrays."""
    scene = ""
    for k, (image, map_, key) in enumerate(zip(images, maps, keys, strict=True)):
        header = f"P5 {image.shape[1]} {image.shape[0]} 255\n".encode()
        (folder / f"{k}.pgm").write_bytes(header + image.astype(np.uint8).tobytes())
        np.save(folder / f"{k}.npy", map_.astype(np.float32))
        scene += f'[[view]]\nimage = "{k}.pgm"\n{name} = "{k}.npy"\n{key}\n'
    (folder / "scene.toml").write_text(f"{scene}[virtual]\n{virtual}\n")
    view = folder / "view.pfm"
    subprocess.run([ibr, "render", folder / "scene.toml", "-o", view], check=True, capture_output=True)
    _, size, _, values = view.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    return 255 * np.frombuffer(values, "<f4").reshape(height, width)[::-1]


@pytest.mark.parametrize("damage", ["outliers", "scattered"])
# Maps that are damaged on purpose.
@pytest.mark.filterwarnings("ignore:.*(agree|seem):UserWarning")
def test_damaged_depth_is_restored_as_by_the_program(ibr, tmp_path, damage):
    """5 % outliers, or 3 % of the depths: what the program makes of them, within a millionth of white."""
    random = np.random.default_rng(4)
    cameras = [Square(-0.5, 0.02), Square(0.5, -0.03)]
    images = [np.round(camera.image()) for camera in cameras]
    truth = Square(0.05, 0.0)

    def damaged(map_):
        chosen = random.uniform(size=map_.shape)
        wild = random.uniform(map_.min(), map_.max(), map_.shape)
        return np.where(chosen < 0.05, wild, map_) if damage == "outliers" else np.where(chosen < 0.03, map_, 0)

    depth = [damaged(camera.depth()).astype(np.float32) for camera in cameras]
    key = lambda camera: f"camera = {camera.matrix().tolist()}"  # noqa: E731
    program = by_the_program(ibr, tmp_path, images, "depth", depth, map(key, cameras), key(truth))
    matrices = [camera.matrix() for camera in cameras]
    view = hb.ibr.render(images, depth=depth, cameras=matrices, camera=truth.matrix())
    np.testing.assert_allclose(view.image, program, atol=255e-6)
    assert np.sqrt(np.mean((view.image - truth.image())[view.mask == 0] ** 2)) < 12
    # A rig of the same pattern: disparities on two planes.
    y, x = np.mgrid[:H, :W]
    disparity = [damaged(np.where((x > 12 - shift) & (x < 26 - shift) & (y > 6), 8.0, 3.0)) for shift in (0, 8)]
    images = [np.round(seen(0.0)), np.round(seen(3.0))]
    keys, folder = ["position = 0.0", "position = 1.0"], tmp_path / "rig"
    folder.mkdir()
    program = by_the_program(ibr, folder, images, "disparity", disparity, keys, "position = 0.5")
    view = hb.ibr.render(images, disparity=disparity, positions=[0, 1], at=0.5)
    np.testing.assert_allclose(view.image, program, atol=255e-6)


# The surfaces of the maps are not those of the images.
@pytest.mark.filterwarnings("ignore:.*(agree|seem):UserWarning")
def test_every_option_of_a_rendering_changes_it():
    random = np.random.default_rng(6)
    images = [seen(shift) + 3 * random.standard_normal((H, W)) for shift in (0.0, 4.0, 8.0)]
    images[1] = 0.8 * images[1]
    disparity = [np.full((H, W), 4.0) for _ in images]
    for map_ in disparity:
        # Two surfaces, and an unknown part of both.
        map_[:, 20:] = 7.0
        map_[4:18, 14:27] = np.nan
    rig = {"disparity": disparity, "positions": [0.0, 1.0, 2.0], "at": 0.4}
    dropped = hb.ibr.render(images, **rig, unknown="drop")
    usual = hb.ibr.render(images, **rig)
    for base, options in [
        (usual, {"offset": 1.5}), (usual, {"nearest": 1}), (usual, {"keep_exposure": True}),
        (usual, {"unknown": "drop"}), (usual, {"unknown": "far"}), (dropped, {"unknown": "drop", "fill": "leave"}),
        (dropped, {"unknown": "drop", "fill": "bridge"}),
    ]:  # fmt: skip
        other = hb.ibr.render(images, **rig, **options)
        assert (other.image != base.image).any(), options
    same = hb.ibr.render(images, **rig, unknown="auto", max_pixels=H * W)
    np.testing.assert_array_equal(same.image, usual.image)
    # Pixels without a sample stay black.
    assert (hb.ibr.render(images, **rig, fill="leave", unknown="drop").image == 0).any()


@pytest.mark.filterwarnings("ignore:the order of depth is undecided")
def test_the_seed_of_the_robust_estimators(square):
    images, tracks, _, points = square
    random = np.random.default_rng(8)
    noisy = tracks + 0.3 * random.standard_normal(tracks.shape)
    wrong = random.random(len(noisy)) < 0.3
    noisy[wrong] = random.uniform(0, 100, noisy[wrong].shape)
    views = [hb.ibr.render(images, tracks=noisy, points=points, seed=seed) for seed in (1, 1, 2)]
    first = hb.ibr.render(images, tracks=noisy, points=points)
    np.testing.assert_array_equal(views[0].image, first.image)
    np.testing.assert_array_equal(views[1].image, first.image)
    assert (views[2].image != first.image).any()


def test_what_does_not_fit_is_refused():
    image, map_ = np.zeros((H, W)), np.ones((H, W))
    rig = {"disparity": [map_], "positions": [0.0], "at": 0.0}
    camera, tracks = np.eye(3, 4), np.ones((5, 2, 2))
    calibrated = {"depth": [map_], "cameras": [camera], "camera": camera}
    for images, keywords, words in [
        ([image], {}, "give disparity, positions and at"),
        ([image, image], rig, "2 images need as many"),
        ([np.zeros(3)], rig, "shape"),
        ([image], {**rig, "disparity": [np.ones((3, 3))]}, "pixels"),
        ([image], {**rig, "unknown": "best"}, "choose auto, far, fill or drop"),
        ([image], {**rig, "fill": "all"}, "choose background, bridge or leave"),
        ([image], {**calibrated, "degree": "square"}, "choose cubic or linear"),
        ([image], {**rig, "degree": "cubic"}, "^degree: it is for views of general cameras"),
        ([image], {**rig, "nearest": 0}, "nearest"),
        ([image], {**rig, "max_pixels": 10}, "10 at most"),
        ([image], {**rig, "seed": 2}, "^seed: it is for views without cameras"),
        ([image] * 2, {"tracks": tracks, "at": 0.5, "degree": "cubic"}, "^degree: it is for views of general cameras"),
        ([image], {"depth": [map_], "cameras": [np.eye(3)], "camera": np.eye(3)}, r"\(3, 4\)"),
        ([image], {**calibrated, "size": (10**6, 10**6)}, "33554432 at most"),
        ([image], {**calibrated, "size": (0, 5)}, "a pixel or more"),
        ([image], {**calibrated, **rig}, "give disparity, positions and at of a rectified rig"),
        ([np.dstack([image] * 4)], rig, r"\(H, W, 3\)"),
        ([np.zeros((0, 4))], rig, r"\(H, W, 3\)"),
        ([np.full((H, W), np.nan)], rig, "not finite"),
        ([image + 0j], rig, "real part"),
        ([], {**rig, "disparity": [], "positions": []}, "no view"),
        ([image] * 2, {"tracks": tracks}, "either points or at"),
        ([image] * 2, {"tracks": tracks, "at": 0.5}, "at least 8"),
        ([image] * 2, {"tracks": tracks[:, :1], "at": 0.5}, r"\(P, 2, 2\)"),
        ([image] * 2, {"tracks": tracks, "points": np.zeros((3, 2))}, r"\(5, 2\)"),
        ([image] * 2, {"tracks": tracks * np.inf, "at": 0.5}, "NaN marks"),
        ([image], {"tracks": tracks[:, :1], "at": 0.5}, "two photographs"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.ibr.render(images, **keywords)
