//! Building blocks of all reports: HTML pages, tables and plots, which do not depend on the subject of a report.

pub(super) mod answer_box;
pub(super) mod bars;
pub(super) mod choice;
pub(super) mod curves;
pub(super) mod decimate;
pub(super) mod drawing;
pub(super) mod evidence;
pub(super) mod figure;
pub(super) mod findings;
pub(super) mod grid;
pub(super) mod heat_map;
pub(super) mod histogram;
pub(super) mod html;
pub(super) mod intervals;
pub(super) mod loop_timing;
pub(super) mod numbers;
pub(super) mod page;
pub(super) mod probabilities;
pub(super) mod table;
pub(super) mod time_figure;
pub(super) mod time_line;
pub(super) mod whiskers;
pub(super) mod write;
pub(super) mod xy;
