use super::*;

fn theta(edges: &[(usize, usize)], n: usize) -> Problem {
    // max <J, X>, tr X = 1, X_ij = 0 on edges; its dual: min t, t I + sum y_e E_e - J >= 0.
    let mut cost = vec![0.0; 1 + edges.len()];
    cost[0] = 1.0;
    let mut terms = vec![(0, Coefficient::identity(n))];
    terms
        .extend(edges.iter().enumerate().map(|(e, &(a, b))| (1 + e, Coefficient::Sparse(vec![(a, b, 1.0)]))));
    let ones = Coefficient::LowRank { vectors: Mat::from_element(n, 1, 1.0), weights: vec![-1.0] };
    Problem::new(cost).unwrap().matrix_inequality(n, ones, terms).unwrap()
}

/// Residual and sign checks that every outcome has to pass, in the problem's own numbers.
fn solve(name: &str, p: &Problem) -> Solution {
    let s = minimise(p, &Settings::default()).unwrap();
    let label = format!("{:?}", s.outcome);
    println!(
        "{name}: {} {} {} {:?} {}",
        &label[..label.len().min(22)],
        s.objective,
        s.dual_objective,
        s.residuals,
        s.iterations
    );
    match &s.outcome {
        Outcome::PrimalInfeasible { certificate } => {
            check_dual_cone(certificate);
            let r = p.dual_residual(0.0, certificate);
            assert!(r.iter().all(|v| v.abs() < 1e-7), "{name}: {r:?}");
            assert!((p.dual_objective(certificate) - 1.0).abs() < 1e-9);
        }
        Outcome::DualInfeasible { certificate } => {
            let fall: f64 = p.cost.iter().zip(certificate).map(|(c, x)| c * x).sum();
            assert!((fall + 1.0).abs() < 1e-9);
            for k in 0..p.matrices.len() {
                let still = p.matrix_at(k, &vec![0.0; p.unknowns()]);
                let f = p.matrix_at(k, certificate) - still;
                assert!(crate::linalg::symmetric_eigenvalues(&f).unwrap()[0] > -1e-8, "{name}");
            }
        }
        Outcome::Solved => {
            check_dual_cone(&s.dual);
            assert!(s.dual_objective <= s.objective + 1e-8 * (1.0 + s.objective.abs()));
            assert!(s.residuals.primal <= 1e-9 && s.residuals.dual <= 1e-9);
        }
        _ => {}
    }
    s
}

fn check_dual_cone(dual: &Dual) {
    assert!(dual.vectors.iter().flatten().all(|z| *z >= 0.0));
    for z in &dual.matrices {
        assert!(crate::linalg::symmetric_eigenvalues(z).unwrap()[0] >= -1e-14 * z.norm());
    }
}

fn expect(name: &str, p: &Problem, want: f64, tolerance: f64) -> Solution {
    let s = solve(name, p);
    assert_eq!(s.outcome, Outcome::Solved, "{name}: {:?}", s.residuals);
    assert!((s.objective - want).abs() < tolerance * (1.0 + want.abs()), "{name}: {} != {want}", s.objective);
    s
}

fn wavy(n: usize, seed: f64) -> Mat {
    crate::linalg::symmetric_part(&Mat::from_fn(n, n, |i, j| {
        (seed + 1.3 * i as f64 + 0.7 * (i * j) as f64).sin()
    }))
}

#[test]
fn theta_numbers() {
    let ring = |n: usize| (0..n).map(|i| (i, (i + 1) % n)).collect::<Vec<_>>();
    for n in [5, 7, 9, 21] {
        // Lovasz 1979: theta(C_n) = n cos(pi/n) / (1 + cos(pi/n)) for odd n.
        let c = (std::f64::consts::PI / n as f64).cos();
        expect("odd ring", &theta(&ring(n), n), n as f64 * c / (1.0 + c), 1e-8);
    }
    expect("no edges", &theta(&[], 6), 6.0, 1e-8);
    let mut complete = Vec::new();
    (0..6).for_each(|i| (0..i).for_each(|j| complete.push((i, j))));
    expect("complete", &theta(&complete, 6), 1.0, 1e-8);
}

#[test]
fn max_cut_relaxation_of_complete_graphs() {
    for n in [3, 4, 8, 15] {
        let laplacian = Mat::from_fn(n, n, |i, j| if i == j { n as f64 - 1.0 } else { -1.0 });
        let terms = (0..n).map(|i| (i, Coefficient::Sparse(vec![(i, i, 1.0)]))).collect();
        let p = Problem::new(vec![1.0; n])
            .and_then(|p| p.matrix_inequality(n, Coefficient::Dense(laplacian * -0.25), terms))
            .unwrap();
        expect("max cut", &p, (n * n) as f64 / 4.0, 1e-8);
    }
}

/// The same problem with its coefficients written in all three ways has the same answer.
#[test]
fn dense_sparse_and_low_rank_agree() {
    let n = 6;
    let one = |i: usize| Mat::from_fn(n, 1, |r, _| f64::from(u8::from(r == i)));
    let ways: [&dyn Fn(usize) -> Coefficient; 3] = [
        &|i| Coefficient::Sparse(vec![(i, i, 1.0)]),
        &|i| Coefficient::Dense(one(i) * one(i).transpose()),
        &|i| Coefficient::LowRank { vectors: one(i), weights: vec![1.0] },
    ];
    let mixed = |shift: usize| {
        let terms = (0..n).map(|i| (i, ways[(i + shift) % 3](i))).collect();
        Problem::new(vec![1.0; n])
            .and_then(|p| p.matrix_inequality(n, Coefficient::Dense(-wavy(n, 0.4)), terms))
            .unwrap()
    };
    let want = solve("ways 0", &mixed(0)).objective;
    (1..3).for_each(|shift| assert!((solve("ways", &mixed(shift)).objective - want).abs() < 1e-8));
}

#[test]
fn largest_eigenvalue_and_matrix_norm() {
    for n in [1, 2, 5, 12] {
        let a = wavy(n, 0.2);
        let p = Problem::new(vec![1.0])
            .and_then(|p| {
                p.matrix_inequality(n, Coefficient::Dense(-&a), vec![(0, Coefficient::identity(n))])
            })
            .unwrap();
        let most = *crate::linalg::symmetric_eigenvalues(&a).unwrap().last().unwrap();
        expect("eigenvalue", &p, most, 1e-8);
        let b = Mat::from_fn(n, 2 * n, |i, j| (1.0 + i as f64 + 2.3 * j as f64).cos());
        let block = Mat::from_fn(3 * n, 3 * n, |i, j| match (i < n, j < n) {
            (true, false) => b[(i, j - n)],
            (false, true) => b[(j, i - n)],
            _ => 0.0,
        });
        let p = Problem::new(vec![1.0])
            .and_then(|p| {
                p.matrix_inequality(3 * n, Coefficient::Dense(block), vec![(0, Coefficient::identity(3 * n))])
            })
            .unwrap();
        expect("norm", &p, crate::linalg::singular_values(&b).unwrap()[0], 1e-8);
    }
}

/// Largest circle in a triangle: centre and radius known from its sides.
#[test]
fn chebyshev_centre_of_a_triangle() {
    // x >= 0, y >= 0, 3x + 4y <= 12: right triangle with sides 4, 3, 5 and inradius 1.
    let p = Problem::new(vec![0.0, 0.0, -1.0])
        .and_then(|p| {
            p.linear_inequalities(
                vec![0.0, 0.0, 12.0],
                vec![
                    (0, 0, 1.0),
                    (0, 2, -1.0),
                    (1, 1, 1.0),
                    (1, 2, -1.0),
                    (2, 0, -3.0),
                    (2, 1, -4.0),
                    (2, 2, -5.0),
                ],
            )
        })
        .unwrap();
    let s = expect("triangle", &p, -1.0, 1e-9);
    assert!(s.x.iter().all(|v| (v - 1.0).abs() < 1e-7), "{:?}", s.x);
}

/// Transport problem with a degenerate optimum: supplies 3, 4; demands 3, 4; costs 1 2 / 3 1.
#[test]
fn degenerate_linear_programme_with_equalities() {
    let a = Mat::from_row_slice(3, 4, &[1., 1., 0., 0., 0., 0., 1., 1., 1., 0., 1., 0.]);
    let p = Problem::new(vec![1.0, 2.0, 3.0, 1.0])
        .and_then(|p| p.linear_inequalities(vec![0.0; 4], (0..4).map(|i| (i, i, 1.0)).collect()))
        .and_then(|p| p.equalities(a, vec![3.0, 4.0, 3.0]))
        .unwrap();
    let s = expect("transport", &p, 7.0, 1e-8);
    assert!((s.dual_objective - 7.0).abs() < 1e-7);
}

/// tr P is least for the solution of the Lyapunov equation itself: P - A'PA >= Q.
#[test]
fn lyapunov_inequality_is_tight_at_the_equation() {
    let a = Mat::from_row_slice(3, 3, &[0.9, 0.5, 0.0, 0.0, -0.7, 0.3, 0.1, 0.0, 0.2]);
    let q = Mat::from_fn(3, 3, |i, j| if i == j { 1.0 } else { 0.3 });
    let (mut cost, mut terms) = (Vec::new(), Vec::new());
    for i in 0..3 {
        for j in 0..=i {
            let mut e = Mat::zeros(3, 3);
            e[(i, j)] = 1.0;
            e[(j, i)] = 1.0;
            cost.push(f64::from(u8::from(i == j)));
            terms.push((terms.len(), Coefficient::Dense(&e - a.transpose() * &e * &a)));
        }
    }
    let p = Problem::new(cost).and_then(|p| p.matrix_inequality(3, Coefficient::Dense(-&q), terms)).unwrap();
    // By summing the series.
    let (mut x, mut power) = (Mat::zeros(3, 3), Mat::identity(3, 3));
    for _ in 0..2000 {
        x += power.transpose() * &q * &power;
        power = &power * &a;
    }
    expect("Lyapunov", &p, x.trace(), 1e-8);
}

/// The bounded real lemma against frequency responses known in closed form.
#[test]
fn bounded_real_lemma_gives_the_h_infinity_norm() {
    // 1 / (z - a): 1 / (1 - |a|).
    for a in [0.5, -0.9, 0.99] {
        let s = bounded_real(
            &Mat::from_element(1, 1, a),
            &Mat::from_element(1, 1, 1.0),
            &Mat::from_element(1, 1, 1.0),
        );
        assert!((s - 1.0 / (1.0 - f64::abs(a))).abs() < 1e-6 / (1.0 - f64::abs(a)), "a = {a}: {s}");
    }
    // Two poles r e^{+-i phi}, 1 / |z^2 - 2 r cos(phi) z + r^2|: the least modulus of the denominator on the
    // circle is (1 - r^2) |sin phi| where the peak lies inside (0, pi).
    let (r, phi) = (0.8f64, 1.1f64);
    let a = Mat::from_row_slice(2, 2, &[2.0 * r * phi.cos(), -r * r, 1.0, 0.0]);
    let s =
        bounded_real(&a, &Mat::from_column_slice(2, 1, &[1.0, 0.0]), &Mat::from_row_slice(1, 2, &[0.0, 1.0]));
    assert!((s * (1.0 - r * r) * phi.sin() - 1.0).abs() < 1e-7, "{s}");
}

fn bounded_real(a: &Mat, b: &Mat, c: &Mat) -> f64 {
    let (n, m, k) = (a.nrows(), b.ncols(), c.nrows());
    let order = n + m + k;
    let ab = Mat::from_fn(n, n + m, |i, j| if j < n { a[(i, j)] } else { b[(i, j - n)] });
    let mut cost = vec![1.0];
    let gamma = (n..order).map(|i| (i, i, 1.0)).collect();
    let mut terms = vec![(0, Coefficient::Sparse(gamma))];
    for i in 0..n {
        for j in 0..=i {
            let mut e = Mat::zeros(n, n);
            e[(i, j)] = 1.0;
            e[(j, i)] = 1.0;
            let mut f = Mat::zeros(order, order);
            f.view_mut((0, 0), (n + m, n + m)).copy_from(&-(ab.transpose() * &e * &ab));
            let mut corner = f.view_mut((0, 0), (n, n));
            corner += &e;
            cost.push(0.0);
            terms.push((terms.len(), Coefficient::Dense(f)));
        }
    }
    let mut constant = Mat::zeros(order, order);
    constant.view_mut((n + m, 0), (k, n)).copy_from(c);
    constant.view_mut((0, n + m), (n, k)).copy_from(&c.transpose());
    let p = Problem::new(cost)
        .and_then(|p| p.matrix_inequality(order, Coefficient::Dense(constant), terms))
        .unwrap();
    let s = solve("bounded real", &p);
    assert!(matches!(s.outcome, Outcome::Solved | Outcome::SolvedInaccurate));
    s.objective
}

#[test]
fn infeasible_problems_come_with_certificates() {
    let lp = Problem::new(vec![1.0])
        .and_then(|p| p.linear_inequalities(vec![-1.0, 0.0], vec![(0, 0, 1.0), (1, 0, -1.0)]))
        .unwrap();
    assert!(matches!(solve("x >= 1, x <= 0", &lp).outcome, Outcome::PrimalInfeasible { .. }));
    let f = Coefficient::Sparse(vec![(0, 0, 1.0), (1, 1, -1.0)]);
    let sdp = Problem::new(vec![1.0])
        .and_then(|p| p.matrix_inequality(2, Coefficient::Sparse(vec![(0, 1, 1.0)]), vec![(0, f)]))
        .unwrap();
    assert!(matches!(solve("[x 1; 1 -x]", &sdp).outcome, Outcome::PrimalInfeasible { .. }));
    let equal = Problem::new(vec![1.0, 1.0])
        .and_then(|p| p.linear_inequalities(vec![0.0; 2], vec![(0, 0, 1.0), (1, 1, 1.0)]))
        .and_then(|p| p.equalities(Mat::from_row_slice(1, 2, &[1.0, 1.0]), vec![-1.0]))
        .unwrap();
    assert!(matches!(solve("x + y = -1", &equal).outcome, Outcome::PrimalInfeasible { .. }));
    // An unstable A has no Lyapunov certificate.
    let unstable = Problem::new(vec![1.0])
        .and_then(|p| {
            p.matrix_inequality(
                1,
                Coefficient::Dense(Mat::from_element(1, 1, -1.0)),
                vec![(0, Coefficient::Dense(Mat::from_element(1, 1, 1.0 - 1.21)))],
            )
        })
        .and_then(|p| p.linear_inequalities(vec![0.0], vec![(0, 0, 1.0)]))
        .unwrap();
    assert!(matches!(solve("unstable", &unstable).outcome, Outcome::PrimalInfeasible { .. }));
}

#[test]
fn unbounded_problems_come_with_rays() {
    let lp = Problem::new(vec![-1.0, 0.0])
        .and_then(|p| p.linear_inequalities(vec![1.0, 0.0], vec![(0, 0, 1.0), (0, 1, -1.0), (1, 1, 1.0)]))
        .unwrap();
    assert!(matches!(solve("ray", &lp).outcome, Outcome::DualInfeasible { .. }));
    let terms = vec![(0, Coefficient::identity(3)), (1, Coefficient::Dense(wavy(3, 1.0)))];
    let sdp = Problem::new(vec![-1.0, 0.2])
        .and_then(|p| p.matrix_inequality(3, Coefficient::zero(), terms))
        .unwrap();
    assert!(matches!(solve("cone", &sdp).outcome, Outcome::DualInfeasible { .. }));
}

/// No interior point on the primal side: [x1 x2; x2 0] >= 0 forces x2 = 0.
#[test]
fn problems_without_interior_are_solved_as_far_as_they_can_be() {
    let terms =
        vec![(0, Coefficient::Sparse(vec![(0, 0, 1.0)])), (1, Coefficient::Sparse(vec![(0, 1, 1.0)]))];
    let p = Problem::new(vec![1.0, 0.5])
        .and_then(|p| p.matrix_inequality(2, Coefficient::zero(), terms))
        .and_then(|p| p.linear_inequalities(vec![-1.0], vec![(0, 0, 1.0)]))
        .unwrap();
    let s = solve("no interior", &p);
    assert!((s.objective - 1.0).abs() < 1e-3, "{s:?}");
    assert!(s.residuals.primal < 1e-3);
}

#[test]
fn units_of_unknowns_rows_and_cost_do_not_matter() {
    let n = 4;
    let plain: Vec<Mat> = (0..3).map(|k| wavy(n, 0.5 + k as f64)).collect();
    let build = |unknown: [f64; 3], row: [f64; 4], cost: f64| {
        let d =
            |m: &Mat, u: f64| Coefficient::Dense(Mat::from_fn(n, n, |i, j| u * row[i] * m[(i, j)] * row[j]));
        let terms = (0..3).map(|k| (k, d(&plain[k], unknown[k]))).collect();
        let c = [plain[0].trace(), plain[1].trace(), plain[2].trace()];
        Problem::new((0..3).map(|k| cost * unknown[k] * c[k]).collect())
            .and_then(|p| p.matrix_inequality(n, d(&Mat::identity(n, n), 1.0), terms))
            .unwrap()
    };
    let want = solve("plain", &build([1.0; 3], [1.0; 4], 1.0)).objective;
    for (unknown, row, cost) in [
        ([1e6, 1e-6, 1.0], [1.0; 4], 1.0),
        ([1.0; 3], [1e4, 1.0, 1e-4, 1.0], 1.0),
        ([1e9, 1.0, 1e-9], [1e3, 1e-3, 1.0, 1.0], 1e-3),
    ] {
        let s = solve("units", &build(unknown, row, cost));
        assert!(matches!(s.outcome, Outcome::Solved | Outcome::SolvedInaccurate), "{:?}", s.residuals);
        assert!(
            (s.objective / cost - want).abs() < 1e-6 * (1.0 + want.abs()),
            "{} {want}",
            s.objective / cost
        );
    }
}

#[test]
fn what_is_no_problem_is_refused() {
    let p = || Problem::new(vec![1.0, 2.0]).unwrap();
    assert!(matches!(Problem::new(vec![f64::NAN]), Err(GeneralError::NotFinite { .. })));
    let term = |c| p().matrix_inequality(2, Coefficient::zero(), vec![(0, c)]);
    assert!(matches!(term(Coefficient::identity(3)), Err(GeneralError::Shape { order: 2, .. })));
    assert!(matches!(term(Coefficient::Dense(Mat::zeros(2, 3))), Err(GeneralError::Shape { .. })));
    let skew = Coefficient::Dense(Mat::from_row_slice(2, 2, &[0.0, 1.0, -1.0, 0.0]));
    assert!(matches!(term(skew), Err(GeneralError::NotSymmetric { row: 1, col: 0, .. })));
    let short = Coefficient::LowRank { vectors: Mat::zeros(2, 1), weights: vec![] };
    assert!(matches!(term(short), Err(GeneralError::Shape { .. })));
    let far = p().matrix_inequality(2, Coefficient::zero(), vec![(2, Coefficient::zero())]);
    assert!(matches!(far, Err(GeneralError::Unknown { unknown: 2, unknowns: 2, .. })));
    assert!(matches!(p().linear_inequalities(vec![0.0], vec![(1, 0, 1.0)]), Err(GeneralError::Shape { .. })));
    assert!(matches!(p().equalities(Mat::zeros(1, 3), vec![0.0]), Err(GeneralError::Equalities { .. })));
}

#[test]
fn few_iterations_are_an_outcome() {
    let settings = Settings { max_iterations: 2, ..Settings::default() };
    let s = minimise(&theta(&[(0, 1)], 4), &settings).unwrap();
    assert_eq!((s.outcome, s.iterations), (Outcome::IterationLimit, 2));
}

/// Digits from cvxpy with Clarabel (tolerances 1e-11) on the same data: two matrix blocks, bounds and
/// an equality.
#[test]
fn general_conic_solver_agrees() {
    let eye = |n: usize, s: f64| Mat::identity(n, n) * s;
    let terms = |n: usize, seed: f64, step: f64| {
        (0..5).map(|k| (k, Coefficient::Dense(wavy(n, seed + step * k as f64)))).collect::<Vec<_>>()
    };
    let p = Problem::new((0..5).map(|k| (1.0 + 2.0 * k as f64).cos()).collect())
        .and_then(|p| p.matrix_inequality(4, Coefficient::Dense(eye(4, 1.0)), terms(4, 0.3, 1.0)))
        .and_then(|p| {
            p.matrix_inequality(6, Coefficient::Dense(eye(6, 2.0) + wavy(6, 9.0)), terms(6, 5.5, -0.4))
        })
        .and_then(|p| p.linear_inequalities(vec![4.0; 5], (0..5).map(|i| (i, i, -1.0)).collect()))
        .and_then(|p| p.equalities(Mat::from_element(1, 5, 1.0), vec![0.25]))
        .unwrap();
    expect("Clarabel", &p, -6.19184220552, 1e-8);
}
