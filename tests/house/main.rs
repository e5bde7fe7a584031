//! The house itself: layers, pages, licences, shipped parameters, numbers that belong to one aircraft.

mod architecture;
mod docs;
mod docs_support;
#[cfg(feature = "sitl")]
mod firmware_parameters;
mod licences;
mod no_number_of_one_aircraft;
