//! The fit of an image against its definition: dense normal equations from the kernel.

use super::super::Fit;
use super::planes::LANES;
use super::*;

/// Numbers in [0, 1) that look random and repeat exactly.
fn scattered(i: usize, k: usize) -> f64 {
    ((i * k + 7) % 1009) as f64 / 1009.0
}

/// Irregular samples of an image, some of them on its border.
fn samples(count: usize, (width, height): (usize, usize)) -> Vec<Fit2Sample<2>> {
    (0..count)
        .map(|i| {
            let (x, y) = (scattered(i, 389), scattered(i, 631));
            let (x, y) = if i % 7 == 0 { (x.round(), y) } else { (x, y) };
            let values = [100.0 + 50.0 * (5.0 * x).sin(), 80.0 * y].map(|v| v as f32);
            let weight = 0.5 + scattered(i, 97) as f32;
            Fit2Sample { x: x * (width as f64 - 1.0), y: y * (height as f64 - 1.0), values, weight }
        })
        .collect()
}

/// Springs that differ from place to place and end at the border.
fn uneven(direction: Direction, (width, height): (usize, usize)) -> Springs {
    let room = |p: usize| match direction {
        Direction::Across => width - 1 - p % width,
        Direction::Down => height - 1 - p / width,
    };
    let of = |reach: usize, k: usize| {
        let weight = |p: usize| if room(p) >= reach { 0.02 + 0.2 * scattered(p, k) as f32 } else { 0.0 };
        (0..width * height).map(weight).collect()
    };
    Springs { edge: of(1, 211), bend: of(2, 577) }
}

/// Row y of springs of a whole grid.
fn row_of(springs: &Springs, width: usize, y: usize) -> Springs {
    let row = y * width..(y + 1) * width;
    Springs { edge: springs.edge[row.clone()].to_vec(), bend: springs.bend[row].to_vec() }
}

/// Solves A u = b by elimination; the rows of `a` end with the right-hand sides.
fn eliminate(mut a: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let n = a.len();
    for k in 0..n {
        let top = a[k].clone();
        for (i, row) in a.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let factor = row[k] / top[k];
            row.iter_mut().zip(&top).for_each(|(x, t)| *x -= factor * t);
            assert!(i != k);
        }
    }
    a.iter().enumerate().map(|(k, row)| row[n..].iter().map(|r| r / row[k]).collect()).collect()
}

/// All splines of a grid at a position, by the kernel.
fn splines<const ORDER: usize>(position: f64, length: usize) -> Vec<f64> {
    let (first, w) = BSpline::<ORDER>::weights(position);
    let mut weights = vec![0.0; length];
    for (j, &weight) in w.iter().enumerate().take(ORDER) {
        let index = first + j as i64 + (ORDER / 2 - 1) as i64;
        if let Some(k) = usize::try_from(index).ok().filter(|k| *k < length) {
            weights[k] = weight;
        }
    }
    weights
}

/// b b' of all splines at a position, and of bicubic ones the third difference of the four around it that
/// takes away the coupling of the first with the last.
fn couplings_of<const ORDER: usize>(position: f64, length: usize) -> Vec<Vec<f64>> {
    let b = splines::<ORDER>(position, length);
    let mut couplings: Vec<Vec<f64>> = b.iter().map(|x| b.iter().map(|y| x * y).collect()).collect();
    let first = position as usize;
    if ORDER == 4 && first + 3 < length {
        let third = [-1.0, 3.0, -3.0, 1.0];
        let share = b[first] * b[first + 3];
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))) {
            couplings[first + i][first + j] += share * third[i] * third[j];
        }
        assert!(couplings[first][first + 3].abs() < 1e-12);
    }
    couplings
}

/// J at the pixels, by the definition.
fn dense<const ORDER: usize>(samples: &[Fit2Sample<2>], (width, height): (usize, usize)) -> Vec<Vec<f64>> {
    let (w, h) = (width + ORDER - 2, height + ORDER - 2);
    let n = w * h;
    let mut a = vec![vec![0.0; n + 2]; n];
    let product =
        |down: &[f64], across: &[f64]| -> Vec<f64> { (0..n).map(|p| down[p / w] * across[p % w]).collect() };
    for s in samples {
        // At the last pixel the slope is that to its left.
        let inside = |position: f64, length: usize| position.min(length as f64 - 1.0 - 1e-9).max(0.0);
        let (x, y) = (inside(s.x, width), inside(s.y, height));
        let value = product(&splines::<ORDER>(y, h), &splines::<ORDER>(x, w));
        let (down, across) = (couplings_of::<ORDER>(y, h), couplings_of::<ORDER>(x, w));
        let weight = f64::from(s.weight);
        for (p, row) in a.iter_mut().enumerate() {
            for q in 0..n {
                row[q] += weight * down[p / w][q / w] * across[p % w][q % w];
            }
            (0..2).for_each(|c| row[n + c] += weight * value[p] * f64::from(s.values[c]));
        }
    }
    for (direction, stride) in [(Direction::Across, 1), (Direction::Down, w)] {
        let springs = uneven(direction, (w, h));
        for p in 0..n {
            let terms = [(springs.edge[p], vec![(p, 1.0), (p + stride, -1.0)])];
            let bends = [(springs.bend[p], vec![(p, 1.0), (p + stride, -2.0), (p + 2 * stride, 1.0)])];
            for (weight, entries) in terms.into_iter().chain(bends).filter(|t| t.0 > 0.0) {
                for (i, x) in &entries {
                    entries.iter().for_each(|(j, y)| a[*i][*j] += f64::from(weight) * x * y);
                }
            }
        }
    }
    let solution = eliminate(a);
    let at = |x: usize, y: usize, c: usize| {
        let (across, down) = (splines::<ORDER>(x as f64, w), splines::<ORDER>(y as f64, h));
        (0..n).map(|p| down[p / w] * across[p % w] * solution[p][c]).sum()
    };
    (0..width * height).map(|p| vec![at(p % width, p / width, 0), at(p % width, p / width, 1)]).collect()
}

fn fitted<const ORDER: usize>(samples: &[Fit2Sample<2>], size: (usize, usize)) -> (Vec<f32>, Convergence) {
    let mut fit = Fit2::<ORDER, 2>::new(size.0, size.1);
    let grid = fit.coefficients();
    let (mut upper, mut lower) = fit.rows().split_at(size.1 / 2);
    // Samples whose splines reach over the border between the parts go into the whole.
    let reach = (size.1 / 2 + 1).saturating_sub(ORDER) as f64;
    let mut rest = Vec::new();
    for s in samples {
        match s.y {
            y if y < reach => upper.add(s),
            y if y >= (size.1 / 2) as f64 => lower.add(s),
            _ => rest.push(*s),
        }
    }
    rest.iter().for_each(|s| fit.rows().add(s));
    let connected = fit.connect(|direction, y| row_of(&uneven(direction, grid), grid.0, y), |_| false);
    connected.solve(&Iteration { tolerance: 1e-7, steps: 400 }, &|_| ())
}

fn check_dense<const ORDER: usize>(size: (usize, usize)) {
    let samples = samples(3 * size.0 * size.1 / 2, size);
    let (values, convergence) = fitted::<ORDER>(&samples, size);
    assert!(convergence.residual < 1e-5, "{convergence:?}");
    for (p, want) in dense::<ORDER>(&samples, size).iter().enumerate() {
        for c in 0..2 {
            let got = f64::from(values[2 * p + c]);
            // Sums in single precision.
            assert!((got - want[c]).abs() < 2e-3, "order {ORDER}, pixel {p}: {got} {}", want[c]);
        }
    }
}

#[test]
fn equal_to_the_dense_solution() {
    check_dense::<2>((7, 6));
    check_dense::<4>((6, 7));
}

/// Images of a pixel or a line, and wider than a block of lanes.
#[test]
fn narrow_and_wide_images() {
    for size in [(1, 1), (1, 5), (5, 1), (LANES + 3, 2)] {
        check_dense::<2>(size);
        check_dense::<4>(size);
    }
}

/// Samples on whole rows without springs between rows: every row is a fit of its own.
#[test]
fn without_springs_down_rows_are_fits() {
    let (size, tau) = ((11, 4), 0.07);
    let mut samples = samples(90, size);
    // The row fit takes no samples at its last knot.
    samples.iter_mut().for_each(|s| (s.x, s.y) = (0.999 * s.x, s.y.round()));
    let mut fit = Fit2::<2, 2>::new(size.0, size.1);
    samples.iter().for_each(|s| fit.rows().add(s));
    let connected = fit.connect(
        |direction, _| {
            let edge = |x: usize| x + 1 < size.0 && direction == Direction::Across;
            let edge = (0..size.0).map(|x| if edge(x) { tau } else { 0.0 }).collect();
            Springs { edge, ..Springs::none(size.0) }
        },
        |_| false,
    );
    let (values, _) = connected.solve(&Iteration { tolerance: 1e-7, steps: 400 }, &|_| ());
    for y in 0..size.1 {
        let mut row = Fit::<2, 2>::new(0, size.0);
        for s in samples.iter().filter(|s| s.y == y as f64) {
            assert!(row.add(s.x, &s.values.map(f64::from), f64::from(s.weight), 0.0));
        }
        row.regularise(f64::from(tau), 0.0);
        row.solve().unwrap();
        for (x, want) in row.coefficients().iter().enumerate() {
            let got = &values[2 * (y * size.0 + x)..][..2];
            assert!((0..2).all(|c| (f64::from(got[c]) - want[c]).abs() < 1e-3), "{x} {y}: {got:?} {want:?}");
        }
    }
}

/// A 1 and the weights are sums of the rows.
#[test]
fn sums_of_rows() {
    let size = (9, 5);
    let mut fit = Fit2::<4, 2>::new(size.0, size.1);
    samples(60, size).iter().for_each(|s| fit.rows().add(s));
    let (width, height) = fit.coefficients();
    let matrix = fit.matrix.clone();
    let mut ones = Planes::zeros(matrix.grid(), 1);
    (0..height).for_each(|y| ones.row_mut(y, 0).fill(1.0));
    let mut image = Planes::zeros(matrix.grid(), 1);
    matrix.multiply::<1>(&ones, &mut image);
    let mut sums = vec![0.0; matrix.grid().stride()];
    for y in 0..height {
        matrix.row_sums(y, &mut sums);
        for (x, (want, sum)) in image.row(y, 0).iter().zip(&sums).enumerate() {
            let local = fit.weights()[y * width + x];
            assert!((sum - want).abs() < 1e-4 && (local - want).abs() < 1e-4, "{x} {y}: {local} {want}");
        }
    }
}

/// The coarse matrix is P' A P, P the blocks.
#[test]
fn blocks_move_as_one() {
    fn check<const ORDER: usize>(size: (usize, usize)) {
        let mut fit = Fit2::<ORDER, 2>::new(size.0, size.1);
        samples(60, size).iter().for_each(|s| fit.rows().add(s));
        let grid = fit.coefficients();
        let fine = fit.connect(|direction, y| row_of(&uneven(direction, grid), grid.0, y), |_| false).matrix;
        let coarse = fine.coarsened();
        let product = |a: &Stencil, one: &dyn Fn(usize, usize) -> bool| {
            let Grid { width, height } = a.grid();
            let (mut u, mut image) = (Planes::zeros(a.grid(), 1), Planes::zeros(a.grid(), 1));
            for y in 0..height {
                (0..width).for_each(|x| u.row_mut(y, 0)[x] = f32::from(u8::from(one(x, y))));
            }
            a.multiply::<1>(&u, &mut image);
            image
        };
        let Grid { width, height } = coarse.grid();
        for unit in 0..coarse.grid().len() {
            let at = (unit % width, unit / width);
            let image = product(&fine, &|x, y| (x / 2, y / 2) == at);
            let mut want = vec![0.0; width * height];
            for y in 0..fine.grid().height {
                let row = image.row(y, 0).iter().enumerate();
                row.for_each(|(x, v)| want[(y / 2) * width + x / 2] += v);
            }
            let got = product(&coarse, &|x, y| (x, y) == at);
            for (p, want) in want.iter().enumerate() {
                let got = got.row(p / width, 0)[p % width];
                assert!((got - want).abs() < 1e-4, "order {ORDER}, {unit} {p}: {got} {want}");
            }
        }
    }
    check::<2>((7, 5));
    check::<4>((8, 5));
}

/// A hole of 200 x 200 coefficients that only springs span: the diagonal preconditioner needs hundreds of
/// steps. A plane has no second differences and is harmonic, so the fit keeps it.
#[test]
fn large_holes_converge() {
    fn check<const ORDER: usize>() {
        let side = 240;
        let tone = |x: usize, y: usize| 60.0 + 0.3 * x as f32 + 0.2 * y as f32;
        let hole = |v: usize| (20..220).contains(&v);
        let mut fit = Fit2::<ORDER, 1>::new(side, side);
        for (x, y) in (0..side * side).map(|p| (p % side, p / side)).filter(|(x, y)| !(hole(*x) && hole(*y)))
        {
            let (x, y, values) = (x as f64, y as f64, [tone(x, y)]);
            fit.rows().add(&Fit2Sample { x, y, values, weight: 1.0 });
        }
        let (width, height) = fit.coefficients();
        let springs = |direction, y: usize| {
            let room = |x: usize| match direction {
                Direction::Across => width - 1 - x,
                Direction::Down => height - 1 - y,
            };
            let of = |reach: usize, weight: f32| {
                (0..width).map(|x| if room(x) >= reach { weight } else { 0.0 }).collect()
            };
            Springs { edge: of(1, 0.12), bend: of(2, 0.02) }
        };
        let connected = fit.connect(springs, |_| false);
        let (values, convergence) = connected.solve(&Iteration { tolerance: 3e-5, steps: 500 }, &|_| ());
        assert!(convergence.reached && convergence.steps < 150, "order {ORDER}: {convergence:?}");
        let got = values[100 * side + 120];
        assert!((got - tone(120, 100)).abs() < 0.5, "order {ORDER}: {got}");
    }
    check::<2>();
    check::<4>();
}

/// Coefficients without samples and springs are 0 and disturb nothing.
#[test]
fn what_is_alone_is_held() {
    let mut fit = Fit2::<2, 1>::new(4, 3);
    fit.rows().add(&Fit2Sample { x: 1.0, y: 1.0, values: [50.0], weight: 2.0 });
    let none = |_, _| Springs::none(4);
    let (values, convergence) =
        fit.connect(none, |p| p != 5).solve(&Iteration { tolerance: 1e-6, steps: 9 }, &|_| ());
    assert!(convergence.reached);
    for (p, value) in values.iter().enumerate() {
        assert_eq!(*value, if p == 5 { 50.0 } else { 0.0 });
    }
}

/// An image without pixels has no values.
#[test]
fn empty_images_are_solved() {
    for (width, height) in [(0, 0), (3, 0), (0, 3)] {
        let connected = Fit2::<2, 1>::new(width, height).connect(|_, _| Springs::none(width), |_| false);
        let (values, convergence) = connected.solve(&Iteration { tolerance: 1e-6, steps: 9 }, &|_| ());
        assert!(values.is_empty() && convergence.reached);
    }
}
