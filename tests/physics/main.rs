//! Forces, moments, effects, formulas, mixers, and the same numbers on every processor.

mod airframe_files;
mod effects;
mod formula;
mod laws;
mod mixer;
mod portable_numbers;
