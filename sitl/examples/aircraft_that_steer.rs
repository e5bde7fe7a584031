//! Prints the properties that command the surfaces of each aircraft of a JSBSim tree, or the reason why none does.
//!
//! ```text
//! cargo run --ignore-rust-version -p greylag-sitl --example aircraft_that_steer -- TREE/aircraft [NAME…]
//! ```

use std::path::PathBuf;

use greylag_sitl::plant::PlantOptions;
use greylag_sitl::plant::discovery::steered;

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(
        arguments.next().ok_or_else(|| anyhow::anyhow!("give the folder of the aircraft"))?,
    );
    let mut names: Vec<String> = arguments.collect();
    if names.is_empty() {
        names = std::fs::read_dir(&folder)?
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| folder.join(name).join(format!("{name}.xml")).is_file())
            .collect();
        names.sort();
    }
    let mut steer = 0;
    for name in &names {
        let options = PlantOptions {
            aircraft_dir: Some(folder.clone()),
            aircraft: name.clone(),
            ..PlantOptions::default()
        };
        match steered(&options) {
            Ok((_, None)) => {
                steer += 1;
                println!("{name:18} as usual");
            }
            Ok((_, Some(found))) => {
                steer += 1;
                println!("{name:18} {}", found.arguments().join(" "));
                found.notes.iter().for_each(|note| println!("{:18}   {note}", ""));
            }
            Err(why) => println!("{name:18} no: {why}"),
        }
    }
    println!("{steer} of {} are steered", names.len());
    Ok(())
}
