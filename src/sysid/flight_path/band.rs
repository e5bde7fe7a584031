//! Solver for the normal equations of the flight-path smoother. They are block-tridiagonal in time (the unknowns of an instant
//! are coupled with those of the next one) and bordered by constants such as sensor errors.
//!
//! The right-hand side is stored as the last column of the constants. The elimination of an instant replaces this column by the
//! right-hand side of the constants' equations. It replaces the last entry of the corner by the minimum of the sum of squares. A
//! stretch of flight is eliminated from both ends towards its middle in parallel. The number of operations is the same as in
//! sequence.

mod blocks;

pub use blocks::{add_gram, add_upper_gram};

use blocks::{BLOCK, add, cholesky, forward, subtract_gram, subtract_products, transposed};

/// Square block of one instant's unknowns.
pub type Block<const N: usize> = [[f64; N]; N];
/// Matrix of one instant's unknowns (rows) by the constants (columns), with the right-hand side in the last column.
pub type Wide<const N: usize, const W: usize> = [[f64; W]; N];
/// Matrix of the constants by the constants, with the right-hand side in the last row and column.
pub type Corner<const W: usize> = [[f64; W]; W];

/// Number of instants of a stretch below which a single thread eliminates both halves.
const WORTH_A_THREAD: usize = 2000;

/// Normal equations of one instant.
#[derive(Clone, Copy, Debug)]
pub struct Node<const N: usize, const W: usize> {
    /// Block of the instant's unknowns.
    pub own: Block<N>,
    /// Coupling with the constants, and the right-hand side.
    pub rest: Wide<N, W>,
}

/// Normal equations that couple an instant with the next one.
#[derive(Clone, Copy, Debug)]
pub struct Link<const N: usize, const W: usize> {
    /// Contribution to the first instant.
    pub first: Node<N, W>,
    /// Contribution to the second instant.
    pub second: Node<N, W>,
    /// Coupling of the two instants: rows of the first, columns of the second instant.
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
    /// Normal equations of the constants. The last entry is the sum of squares, minimised over the eliminated unknowns.
    pub corner: Corner<W>,
    /// Logarithm of the determinant of the eliminated block.
    pub log_det: f64,
}

impl<const W: usize> Left<W> {
    /// Equations without any contribution.
    pub const ZERO: Self = Left { corner: [[0.0; W]; W], log_det: 0.0 };

    /// Subtracts the contribution of an eliminated instant from the upper triangle; `mirror` completes the lower one.
    fn take<const N: usize>(&mut self, done: &Eliminated<N, W>) {
        // The corner takes most of the computing time. It is symmetric, so for each row the columns to the left of its own block
        // are skipped.
        for (i, sums) in self.corner.iter_mut().enumerate() {
            let by: [f64; N] = std::array::from_fn(|k| done.rest[k][i]);
            subtract_products(sums, &by, &done.rest, i / BLOCK * BLOCK);
        }
        self.log_det += 2.0 * (0..N).map(|i| done.factor[i][i]).product::<f64>().ln();
    }

    /// Copies the upper triangle to the lower one.
    fn mirror(&mut self) {
        for i in 1..W {
            for j in 0..i {
                self.corner[i][j] = self.corner[j][i];
            }
        }
    }

    /// Adds the equations of another part of a stretch, or of another stretch.
    pub fn add(&mut self, other: &Self) {
        add(&mut self.corner, &other.corner);
        self.log_det += other.log_det;
    }
}

/// An instant after elimination: its unknowns x satisfy `factorᵀ x = rest · (−p, 1) − next · x'`. Here x' are the unknowns of
/// the neighbour nearer to the middle, and p are the constants.
#[derive(Clone, Copy, Debug)]
struct Eliminated<const N: usize, const W: usize> {
    factor: Block<N>,
    next: Block<N>,
    rest: Wide<N, W>,
}

/// Part of an elimination that stays in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keep {
    /// Only the equations of the constants.
    Constants,
    /// All eliminated instants, for the back substitution.
    Instants,
    /// The equations at every [`PART`]-th instant. The back substitution eliminates the instants between them again. An
    /// instant with all constants takes 2.6 kB of memory, so an hour of flight would take a gigabyte.
    Parts,
}

/// Number of instants that the back substitution eliminates again in one go.
const PART: usize = 512;

/// Elimination of one side of a stretch, from its end towards the middle.
#[derive(Clone, Debug)]
struct Side<const N: usize, const W: usize> {
    done: Vec<Eliminated<N, W>>,
    /// Contributions to every [`PART`]-th instant from the instants that were eliminated before it.
    parts: Vec<Node<N, W>>,
}

/// A stretch after elimination.
#[derive(Clone, Debug)]
pub struct Stretch<const N: usize, const W: usize> {
    head: Side<N, W>,
    middle: Eliminated<N, W>,
    tail: Side<N, W>,
}

/// Equations of a stretch.
pub trait Equations<const N: usize, const W: usize>: Sync {
    /// Number of instants of the stretch.
    fn count(&self) -> usize;
    /// Adds the equations of instant `k` to `node` and, if the constants are asked for, to the upper triangle of their `corner`.
    fn instant(&self, k: usize, node: &mut Node<N, W>, corner: Option<&mut Corner<W>>);
    /// The equations that couple instant `k` to the next one; the part of the constants goes to the upper triangle of `corner`.
    fn link(&self, k: usize, corner: Option<&mut Corner<W>>) -> Link<N, W>;
}

/// Eliminates one instant that is coupled with one neighbour; `None` if its block is not positive definite.
fn one<const N: usize, const W: usize>(
    node: &Node<N, W>,
    coupling: &Block<N>,
    neighbour: &mut Node<N, W>,
) -> Option<Eliminated<N, W>> {
    let factor = cholesky(&node.own)?;
    let (mut next, mut rest) = (*coupling, node.rest);
    forward(&factor, &mut next);
    forward(&factor, &mut rest);
    subtract_gram(&mut neighbour.own, &next, &next);
    subtract_gram(&mut neighbour.rest, &next, &rest);
    Some(Eliminated { factor, next, rest })
}

/// Direction in which a side is eliminated.
#[derive(Clone, Copy)]
enum Towards {
    Later,
    Earlier,
}

impl Towards {
    /// Eliminates instant `k`. On entry `pending` holds the contributions of the instant eliminated before to `k`; on return it
    /// holds the contributions of `k` to the next instant. The equations of the constants are updated in `left`, if it is given.
    fn eliminate<const N: usize, const W: usize>(
        self,
        k: usize,
        equations: &impl Equations<N, W>,
        pending: &mut Node<N, W>,
        mut left: Option<&mut Left<W>>,
    ) -> Option<Eliminated<N, W>> {
        let mut node = *pending;
        equations.instant(k, &mut node, left.as_mut().map(|left| &mut left.corner));
        let corner = left.as_mut().map(|left| &mut left.corner);
        let coupling = match self {
            Towards::Later => {
                let link = equations.link(k, corner);
                node.add(&link.first);
                *pending = link.second;
                link.coupling
            }
            Towards::Earlier => {
                let link = equations.link(k - 1, corner);
                node.add(&link.second);
                *pending = link.first;
                transposed(&link.coupling)
            }
        };
        let done = one(&node, &coupling, pending)?;
        if let Some(left) = left {
            left.take(&done);
        }
        Some(done)
    }

    /// Index of the instant that is eliminated after `before` other instants, in a stretch of `count` instants.
    fn place(self, before: usize, count: usize) -> usize {
        match self {
            Towards::Later => before,
            Towards::Earlier => count - 1 - before,
        }
    }

    /// Eliminates the first `length` instants of a side. Returns the side, the contributions to the next instant, and the
    /// equations of the constants.
    fn side<const N: usize, const W: usize>(
        self,
        length: usize,
        equations: &impl Equations<N, W>,
        keep: Keep,
    ) -> Option<(Side<N, W>, Node<N, W>, Left<W>)> {
        let (mut left, mut pending) = (Left::ZERO, Node::ZERO);
        let mut side = Side { done: Vec::new(), parts: Vec::new() };
        match keep {
            Keep::Constants => {}
            Keep::Instants => side.done.reserve_exact(length),
            Keep::Parts => side.parts.reserve_exact(length.div_ceil(PART)),
        }
        for before in 0..length {
            if keep == Keep::Parts && before.is_multiple_of(PART) {
                side.parts.push(pending);
            }
            let k = self.place(before, equations.count());
            let done = self.eliminate(k, equations, &mut pending, Some(&mut left))?;
            if keep == Keep::Instants {
                side.done.push(done);
            }
        }
        Some((side, pending, left))
    }

    /// Computes the unknowns of a side of `length` instants, in order from the middle outwards. `middle` holds the unknowns of
    /// the middle instant, `by` the negated constants followed by one.
    fn solve<const N: usize, const W: usize>(
        self,
        side: &Side<N, W>,
        length: usize,
        equations: &impl Equations<N, W>,
        by: &[f64; W],
        middle: [f64; N],
    ) -> Option<Vec<[f64; N]>> {
        let (mut after, mut all) = (middle, Vec::with_capacity(length));
        let mut take = |done: &[Eliminated<N, W>]| {
            for eliminated in done.iter().rev() {
                after = eliminated.solve(by, &after);
                all.push(after);
            }
        };
        take(&side.done);
        let mut again = Vec::with_capacity(PART.min(length));
        for (part, pending) in side.parts.iter().enumerate().rev() {
            let mut pending = *pending;
            again.clear();
            for before in part * PART..length.min((part + 1) * PART) {
                let k = self.place(before, equations.count());
                again.push(self.eliminate(k, equations, &mut pending, None)?);
            }
            take(&again);
        }
        Some(all)
    }
}

/// Eliminates the instants of a stretch; `None` if a block is not positive definite.
pub fn eliminate<const N: usize, const W: usize>(
    equations: &impl Equations<N, W>,
    keep: Keep,
) -> Option<(Stretch<N, W>, Left<W>)> {
    let count = equations.count();
    let middle = count / 2;
    let head = || Towards::Later.side(middle, equations, keep);
    let tail = || Towards::Earlier.side(count - middle - 1, equations, keep);
    let (head, tail) =
        if count < WORTH_A_THREAD { (head(), tail()) } else { rayon::join(head, tail) };
    let ((head, mut node, mut left), (tail, from_tail, left_tail)) = (head?, tail?);
    left.add(&left_tail);
    node.add(&from_tail);
    equations.instant(middle, &mut node, Some(&mut left.corner));
    let none = [[0.0; N]; N];
    let middle = one(&node, &none, &mut { Node::ZERO })?;
    left.take(&middle);
    left.mirror();
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
    /// Computes the unknowns of all instants, in order of time. `by` holds the negated constants, followed by one. `None` if a
    /// repeated elimination fails, or if the elimination kept only the constants.
    pub fn substitute(
        &self,
        equations: &impl Equations<N, W>,
        by: &[f64; W],
    ) -> Option<Vec<[f64; N]>> {
        let (count, middle) = (equations.count(), self.middle.solve(by, &[0.0; N]));
        let (before, after) = (count / 2, count - count / 2 - 1);
        let (head, tail) = rayon::join(
            || Towards::Later.solve(&self.head, before, equations, by, middle),
            || Towards::Earlier.solve(&self.tail, after, equations, by, middle),
        );
        // a third list of this length would take much memory in a long flight
        let (mut all, tail) = (head?, tail?);
        all.reverse();
        all.reserve_exact(1 + tail.len());
        all.push(middle);
        all.extend(tail);
        (all.len() == count).then_some(all)
    }
}

#[cfg(test)]
mod tests;
