//! The yardsticks of all later controllers, on a small part of the target file.
#![cfg(feature = "sitl")]
