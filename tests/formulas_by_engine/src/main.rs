//! Symbolic regression of a table on standard input: rows of numbers with commas, the last one the target. Prints the front,
//! a line a formula: size, mean squared error, formula (variables x0, x1, …).

use std::io::Read;

use ndarray::{Array1, Array2};
use symbolic_regression::prelude::*;

/// Most nodes of a formula, with room for a coefficient and an offset beside the nine that `propose` has.
const MOST_NODES: usize = 13;
/// Rounds of the evolution: about 10 s on two cores.
const ROUNDS: usize = 8;

fn main() {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).expect("reading the table from standard input");
    let number =
        |word: &str| word.parse::<f32>().unwrap_or_else(|_| panic!("{word:?} is no number"));
    let rows: Vec<Vec<f32>> = text.lines().map(|l| l.split(',').map(number).collect()).collect();
    let width = rows.first().expect("the table is empty").len() - 1;
    let x = Array2::from_shape_fn((width, rows.len()), |(k, row)| rows[row][k]);
    let y = Array1::from_iter(rows.iter().map(|row| row[width]));
    let operators =
        BuiltinOpsF32::from_names(["abs", "tanh", "exp", "+", "sub", "*", "/", "max", "min"])
            .expect("the names of the operators");
    let options = Options::<f32, 2> {
        operators,
        seed: 1,
        niterations: ROUNDS,
        populations: 8,
        maxsize: MOST_NODES,
        deterministic: true,
        progress: false,
        ..Default::default()
    };
    let result = equation_search::<_, BuiltinOpsF32, 2>(&Dataset::new(x, y), &options);
    for member in result.hall_of_fame.pareto_front() {
        println!("{}\t{}\t{}", member.complexity, member.loss, member.expr);
    }
}
