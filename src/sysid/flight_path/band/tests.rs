//! Tests of the solver for the smoother's normal equations, which are block-tridiagonal in time and bordered by constants.

use super::*;
use nalgebra::{DMatrix, DVector};

/// Equations from given links (equations that couple two successive instants), with unit prior information on every unknown of
/// an instant.
struct Given<const N: usize, const W: usize> {
    links: Vec<Link<N, W>>,
}

impl<const N: usize, const W: usize> Equations<N, W> for Given<N, W> {
    fn count(&self) -> usize {
        self.links.len() + 1
    }
    fn instant(&self, _: usize, node: &mut Node<N, W>, _: Option<&mut Corner<W>>) {
        (0..N).for_each(|i| node.own[i][i] += 1.0);
    }
    fn link(&self, k: usize, _: Option<&mut Corner<W>>) -> Link<N, W> {
        self.links[k]
    }
}

/// If only some of the eliminated instants are kept, and the others are eliminated again for the back substitution, the solution
/// is the same to the bit.
#[test]
fn parts_equal_the_whole() {
    let mut seed = 1_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
    };
    let mut links = Vec::new();
    for _ in 0..5 * PART / 2 {
        let [first, second] = [(); 2].map(|()| [[(); 3]; 2].map(|row| row.map(|()| random())));
        let rest = [[(); 4]; 2].map(|row| row.map(|()| random()));
        let zero = Node::<3, 4>::ZERO;
        let mut link = Link { first: zero, second: zero, coupling: [[0.0; 3]; 3] };
        add_gram(&mut link.first.own, &first, &first);
        add_gram(&mut link.second.own, &second, &second);
        add_gram(&mut link.coupling, &first, &second);
        add_gram(&mut link.first.rest, &first, &rest);
        add_gram(&mut link.second.rest, &second, &rest);
        links.push(link);
    }
    let equations = Given { links };
    let (whole, left) = eliminate(&equations, Keep::Instants).unwrap();
    let (parts, again) = eliminate(&equations, Keep::Parts).unwrap();
    assert_eq!((left.corner, left.log_det), (again.corner, again.log_det));
    assert!(parts.head.done.is_empty() && parts.head.parts.len() == 2);
    let by = [0.3, -0.2, 0.5, 1.0];
    let solution = whole.substitute(&equations, &by).unwrap();
    assert_eq!(parts.substitute(&equations, &by).unwrap(), solution);
    let (none, left) = eliminate(&equations, Keep::Constants).unwrap();
    assert_eq!(left.corner, again.corner);
    assert!(none.substitute(&equations, &by).is_none());
}

/// The solution equals that of the same equations as a dense matrix.
#[test]
fn band_equals_dense() {
    const N: usize = 6;
    const C: usize = 5;
    const COUNT: usize = 7;
    let size = COUNT * N + C;
    // each residual depends on two successive instants and on the constants, with pseudo-random coefficients
    let mut seed = 1_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
    };
    let mut dense = DMatrix::<f64>::identity(size, size);
    let mut right = DVector::<f64>::zeros(size);
    let mut links =
        vec![
            Link { first: Node::<N, { C + 1 }>::ZERO, second: Node::ZERO, coupling: [[0.0; N]; N] };
            COUNT - 1
        ];
    let mut corner = [[0.0; C + 1]; C + 1];
    (0..C).for_each(|i| corner[i][i] = 1.0);
    for k in 0..COUNT - 1 {
        for _ in 0..10 {
            let mut draw = [[0.0; N]; 1].map(|row| row.map(|_| random()));
            let first = draw;
            draw = draw.map(|row| row.map(|_| random()));
            let second = draw;
            let rest = [[0.0; C + 1]; 1].map(|row| row.map(|_| random()));
            let mut j = DVector::<f64>::zeros(size);
            for i in 0..N {
                j[k * N + i] = first[0][i];
                j[k * N + N + i] = second[0][i];
            }
            (0..C).for_each(|i| j[COUNT * N + i] = rest[0][i]);
            dense += &j * j.transpose();
            right += &j * rest[0][C];
            let link = &mut links[k];
            add_gram(&mut link.first.own, &first, &first);
            add_gram(&mut link.second.own, &second, &second);
            add_gram(&mut link.coupling, &first, &second);
            add_gram(&mut link.first.rest, &first, &rest);
            add_gram(&mut link.second.rest, &second, &rest);
            add_gram(&mut corner, &rest, &rest);
        }
    }
    let equations = Given { links };
    let (stretch, mut left) = eliminate(&equations, Keep::Instants).unwrap();
    add(&mut left.corner, &corner);
    let matrix = DMatrix::from_fn(C, C, |i, j| left.corner[i][j]);
    let factor = matrix.cholesky().unwrap();
    let b = DVector::from_fn(C, |i, _| left.corner[i][C]);
    let p = factor.solve(&b);
    let by = std::array::from_fn(|i| if i < C { -p[i] } else { 1.0 });
    let x = stretch.substitute(&equations, &by).unwrap();
    let reference = dense.clone().lu().solve(&right).unwrap();
    for (k, node) in x.iter().enumerate() {
        for i in 0..N {
            assert!((node[i] - reference[k * N + i]).abs() < 1e-11);
        }
    }
    assert!((p.clone() - reference.rows(COUNT * N, C)).norm() < 1e-11);
    // the smallest sum of squares is the sum at zero unknowns minus its reduction by the dense solution
    let least = left.corner[C][C] - b.dot(&p);
    assert!((least - (corner[C][C] - right.dot(&reference))).abs() < 1e-11);
    let log_det = left.log_det + factor.determinant().ln();
    assert!((log_det - dense.determinant().ln()).abs() < 1e-10);
}
