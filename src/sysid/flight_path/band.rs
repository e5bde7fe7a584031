//! Normal equations that are block-tridiagonal in time, bordered by constants.
//!
//! The right-hand side is the last column of the constants. Elimination turns this column into the solution. The last
//! entry of the corner becomes the minimum of the sum of squares. A stretch is eliminated from both ends towards its middle
//! in parallel, with the same number of operations as in sequence.

/// Square block of one instant's unknowns.
pub type Block<const N: usize> = [[f64; N]; N];
/// Matrix of one instant's unknowns (rows) by the constants (columns), with the right-hand side in the last column.
pub type Wide<const N: usize, const W: usize> = [[f64; W]; N];
/// Matrix of the constants by the constants, with the right-hand side in the last row and column.
pub type Corner<const W: usize> = [[f64; W]; W];

/// Number of instants below which one thread eliminates both halves.
const WORTH_A_THREAD: usize = 2000;

/// Normal equations of one instant.
#[derive(Clone, Copy, Debug)]
pub struct Node<const N: usize, const W: usize> {
    /// Block of the instant's unknowns.
    pub own: Block<N>,
    /// Coupling with the constants.
    pub rest: Wide<N, W>,
}

/// Normal equations that couple an instant with the next one.
#[derive(Clone, Copy, Debug)]
pub struct Link<const N: usize, const W: usize> {
    /// Contribution to the first instant.
    pub first: Node<N, W>,
    /// Contribution to the second instant.
    pub second: Node<N, W>,
    /// Coupling: rows of the first, columns of the second instant.
    pub coupling: Block<N>,
}

impl<const N: usize, const W: usize> Node<N, W> {
    /// A node without equations.
    pub const ZERO: Self = Node { own: [[0.0; N]; N], rest: [[0.0; W]; N] };

    fn add(&mut self, other: &Self) {
        add(&mut self.own, &other.own);
        add(&mut self.rest, &other.rest);
    }
}

/// Equations of the constants after elimination.
#[derive(Clone, Copy, Debug)]
pub struct Left<const W: usize> {
    /// Normal equations of the constants; the last entry is the sum of squares.
    pub corner: Corner<W>,
    /// Logarithm of the determinant of the eliminated block.
    pub log_det: f64,
}

impl<const W: usize> Left<W> {
    /// The neutral element of `add`.
    pub const ZERO: Self = Left { corner: [[0.0; W]; W], log_det: 0.0 };

    /// Adds the contribution of another stretch or half of a stretch.
    pub fn add(&mut self, other: &Self) {
        add(&mut self.corner, &other.corner);
        self.log_det += other.log_det;
    }
}

/// An instant after elimination: `factorᵀ x = rest · (−p, 1) − next · x'`. Here x' are the unknowns of the neighbour nearer
/// to the middle, and p are the constants.
#[derive(Clone, Copy, Debug)]
struct Eliminated<const N: usize, const W: usize> {
    factor: Block<N>,
    next: Block<N>,
    rest: Wide<N, W>,
}

/// A stretch after elimination.
#[derive(Clone, Debug)]
pub struct Stretch<const N: usize, const W: usize> {
    /// Instants before the middle, in order of time.
    head: Vec<Eliminated<N, W>>,
    middle: Eliminated<N, W>,
    /// Instants after the middle, in reverse order of time.
    tail: Vec<Eliminated<N, W>>,
}

/// `into += xᵀ y`.
pub fn add_gram<const R: usize, const A: usize, const B: usize>(
    into: &mut [[f64; B]; A],
    x: &[[f64; A]; R],
    y: &[[f64; B]; R],
) {
    for (i, row) in into.iter_mut().enumerate() {
        for (x, y) in x.iter().zip(y) {
            for (sum, y) in row.iter_mut().zip(y) {
                *sum += x[i] * y;
            }
        }
    }
}

fn subtract_gram<const R: usize, const A: usize, const B: usize>(
    into: &mut [[f64; B]; A],
    x: &[[f64; A]; R],
    y: &[[f64; B]; R],
) {
    for (i, row) in into.iter_mut().enumerate() {
        for (x, y) in x.iter().zip(y) {
            for (sum, y) in row.iter_mut().zip(y) {
                *sum -= x[i] * y;
            }
        }
    }
}

fn add<const A: usize, const B: usize>(into: &mut [[f64; B]; A], other: &[[f64; B]; A]) {
    for (row, other) in into.iter_mut().zip(other) {
        row.iter_mut().zip(other).for_each(|(x, y)| *x += y);
    }
}

/// Lower Cholesky factor L with L Lᵀ = `a`; `None` if `a` is not positive definite.
fn cholesky<const N: usize>(a: &Block<N>) -> Option<Block<N>> {
    let mut l = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let left = a[i][j] - dot;
            l[i][j] = if i == j { left.sqrt() } else { left / l[j][j] };
        }
        if !(l[i][i].is_finite() && l[i][i] > 0.0) {
            return None;
        }
    }
    Some(l)
}

/// Solves L y = `y` in place.
fn forward<const N: usize, const W: usize>(l: &Block<N>, y: &mut Wide<N, W>) {
    for (i, by) in l.iter().enumerate() {
        let (done, rest) = y.split_at_mut(i);
        let row = &mut rest[0];
        for (by, done) in by.iter().zip(done.iter()) {
            row.iter_mut().zip(done).for_each(|(x, d)| *x -= by * d);
        }
        let scale = by[i].recip();
        row.iter_mut().for_each(|x| *x *= scale);
    }
}

/// Eliminates one instant that is coupled with one neighbour; `None` if its block is not positive definite.
fn one<const N: usize, const W: usize>(
    node: &Node<N, W>,
    coupling: &Block<N>,
    neighbour: &mut Node<N, W>,
    left: &mut Left<W>,
) -> Option<Eliminated<N, W>> {
    let factor = cholesky(&node.own)?;
    let (mut next, mut rest) = (*coupling, node.rest);
    forward(&factor, &mut next);
    forward(&factor, &mut rest);
    subtract_gram(&mut neighbour.own, &next, &next);
    subtract_gram(&mut neighbour.rest, &next, &rest);
    subtract_gram(&mut left.corner, &rest, &rest);
    left.log_det += 2.0 * (0..N).map(|i| factor[i][i]).product::<f64>().ln();
    Some(Eliminated { factor, next, rest })
}

fn transposed<const N: usize>(a: &Block<N>) -> Block<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// Eliminates the instants `0..count` of a stretch; `None` if a block is not positive definite.
///
/// `instant(k, node, corner)` adds the equations of instant `k`. `link(k, corner)` returns the equations that couple instants
/// `k` and `k + 1`.
pub fn eliminate<const N: usize, const W: usize>(
    count: usize,
    instant: impl Fn(usize, &mut Node<N, W>, &mut Corner<W>) + Sync,
    link: impl Fn(usize, &mut Corner<W>) -> Link<N, W> + Sync,
) -> Option<(Stretch<N, W>, Left<W>)> {
    let middle = count / 2;
    let head = || {
        let (mut left, mut pending) = (Left::ZERO, Node::ZERO);
        let mut done = Vec::with_capacity(middle);
        for k in 0..middle {
            let mut node = pending;
            instant(k, &mut node, &mut left.corner);
            let link = link(k, &mut left.corner);
            node.add(&link.first);
            pending = link.second;
            done.push(one(&node, &link.coupling, &mut pending, &mut left)?);
        }
        Some((done, pending, left))
    };
    let tail = || {
        let (mut left, mut pending) = (Left::ZERO, Node::ZERO);
        let mut done = Vec::with_capacity(count - middle);
        for k in (middle + 1..count).rev() {
            let mut node = pending;
            instant(k, &mut node, &mut left.corner);
            let link = link(k - 1, &mut left.corner);
            node.add(&link.second);
            pending = link.first;
            done.push(one(&node, &transposed(&link.coupling), &mut pending, &mut left)?);
        }
        Some((done, pending, left))
    };
    let (head, tail) =
        if count < WORTH_A_THREAD { (head(), tail()) } else { rayon::join(head, tail) };
    let ((head, mut node, mut left), (tail, from_tail, left_tail)) = (head?, tail?);
    left.add(&left_tail);
    node.add(&from_tail);
    instant(middle, &mut node, &mut left.corner);
    let none = [[0.0; N]; N];
    let middle = one(&node, &none, &mut { Node::ZERO }, &mut left)?;
    Some((Stretch { head, middle, tail }, left))
}

impl<const N: usize, const W: usize> Eliminated<N, W> {
    fn solve(&self, by: &[f64; W], neighbour: &[f64; N]) -> [f64; N] {
        let mut x: [f64; N] = std::array::from_fn(|i| {
            let rest: f64 = self.rest[i].iter().zip(by).map(|(r, p)| r * p).sum();
            let next: f64 = self.next[i].iter().zip(neighbour).map(|(n, x)| n * x).sum();
            rest - next
        });
        for i in (0..N).rev() {
            let dot: f64 = (i + 1..N).map(|j| self.factor[j][i] * x[j]).sum();
            x[i] = (x[i] - dot) / self.factor[i][i];
        }
        x
    }
}

impl<const N: usize, const W: usize> Stretch<N, W> {
    /// The unknowns in order of time. `by` holds the negated constants, followed by the number 1.
    pub fn substitute(&self, by: &[f64; W]) -> Vec<[f64; N]> {
        let middle = self.middle.solve(by, &[0.0; N]);
        let walk = |side: &[Eliminated<N, W>]| {
            let mut after = middle;
            let step = |e: &Eliminated<N, W>| {
                after = e.solve(by, &after);
                after
            };
            side.iter().rev().map(step).collect::<Vec<_>>()
        };
        let (head, tail) = rayon::join(|| walk(&self.head), || walk(&self.tail));
        head.into_iter().rev().chain([middle]).chain(tail).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The band solution equals a dense solution of the same system.
    #[test]
    fn band_equals_dense() {
        const N: usize = 6;
        const C: usize = 5;
        const COUNT: usize = 7;
        let size = COUNT * N + C;
        // residuals with pseudo-random coefficients; each residual depends on two adjacent instants and the constants
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
        };
        let mut dense = DMatrix::<f64>::identity(size, size);
        let mut right = DVector::<f64>::zeros(size);
        let mut links = vec![
            Link {
                first: Node::<N, { C + 1 }>::ZERO,
                second: Node::ZERO,
                coupling: [[0.0; N]; N]
            };
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
        let instant = |_: usize, node: &mut Node<N, { C + 1 }>, _: &mut Corner<{ C + 1 }>| {
            (0..N).for_each(|i| node.own[i][i] += 1.0);
        };
        let (stretch, mut left) = eliminate(COUNT, instant, |k, _| links[k]).unwrap();
        add(&mut left.corner, &corner);
        let matrix = DMatrix::from_fn(C, C, |i, j| left.corner[i][j]);
        let factor = matrix.cholesky().unwrap();
        let b = DVector::from_fn(C, |i, _| left.corner[i][C]);
        let p = factor.solve(&b);
        let by = std::array::from_fn(|i| if i < C { -p[i] } else { 1.0 });
        let x = stretch.substitute(&by);
        let reference = dense.clone().lu().solve(&right).unwrap();
        for (k, node) in x.iter().enumerate() {
            for i in 0..N {
                assert!((node[i] - reference[k * N + i]).abs() < 1e-11);
            }
        }
        assert!((p.clone() - reference.rows(COUNT * N, C)).norm() < 1e-11);
        // minimum of the sum of squares: Σ r² less its reduction by the dense solution
        let least = left.corner[C][C] - b.dot(&p);
        assert!((least - (corner[C][C] - right.dot(&reference))).abs() < 1e-11);
        let log_det = left.log_det + factor.determinant().ln();
        assert!((log_det - dense.determinant().ln()).abs() < 1e-10);
    }
}
