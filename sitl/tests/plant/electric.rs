//! A model aircraft with an electric engine, whose propeller JSBSim leaves at rest when the engine is started.

use std::fs;

use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start};

const MOTOR: &str =
    r#"<electric_engine name="motor"><power unit="WATTS">500</power></electric_engine>"#;

const PROPELLER: &str = r#"<propeller name="propeller"><ixx unit="KG*M2">1.3e-4</ixx><diameter unit="IN">12</diameter><numblades>2</numblades>
<table name="C_THRUST" type="internal"><tableData>
0 0.11
0.4 0.07
0.8 0.0
1.0 -0.04
</tableData></table>
<table name="C_POWER" type="internal"><tableData>
0 0.045
0.4 0.04
0.8 0.01
1.0 -0.01
</tableData></table></propeller>"#;

const AIRCRAFT: &str = r#"<fdm_config name="toy" version="2.0">
<metrics><wingarea unit="M2">0.4</wingarea><wingspan unit="M">1.5</wingspan><chord unit="M">0.27</chord>
<location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location></metrics>
<mass_balance><ixx unit="KG*M2">0.1</ixx><iyy unit="KG*M2">0.1</iyy><izz unit="KG*M2">0.2</izz><emptywt unit="KG">2</emptywt>
<location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<ground_reactions/>
<propulsion><engine file="motor"><thruster file="propeller"><location unit="M"><x>-0.2</x><y>0</y><z>0</z></location></thruster></engine></propulsion>
<flight_control name="none"><channel name="throttle"><pure_gain name="throttle">
<input>fcs/throttle-cmd-norm</input><gain>1</gain><output>fcs/throttle-pos-norm</output></pure_gain></channel></flight_control>
<aerodynamics><axis name="DRAG"><function name="aero/drag"><product>
<property>aero/qbar-area</property><value>0.05</value></product></function></axis></aerodynamics>
</fdm_config>"#;

/// For a propeller at rest, the first frame at full throttle would give 300,000 rpm and a thrust of hundreds of times
/// the weight.
#[test]
fn a_flight_begins_with_a_turning_propeller() {
    let tree = tempfile::tempdir().unwrap();
    let files = [
        ("engine/motor.xml", MOTOR),
        ("engine/propeller.xml", PROPELLER),
        ("aircraft/toy/toy.xml", AIRCRAFT),
    ];
    for (name, text) in files {
        let path = tree.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let options = PlantOptions {
        aircraft_dir: Some(tree.path().join("aircraft")),
        aircraft: "toy".into(),
        ..PlantOptions::default()
    };
    let mut plant = Plant::new(&options).unwrap();
    let start = Start { airspeed_mps: 17.0, ..Start::NEUTRAL };
    let truth = plant.reset(&start).unwrap();
    assert_eq!(truth.throttle, 0.0);
    assert!((truth.airspeed_mps - 17.0).abs() < 1e-9, "{}", truth.airspeed_mps);
    let weight = plant.property("inertia/weight-lbs").unwrap();
    for _ in 0..200 {
        plant.step(Inputs { throttle: 1.0, ..Inputs::default() }).unwrap();
        let speed = plant.property("propulsion/engine[0]/propeller-rpm").unwrap();
        let thrust = plant.property("propulsion/engine[0]/thrust-lbs").unwrap();
        assert!(speed > 500.0 && speed < 20_000.0 && thrust < 3.0 * weight, "{speed} {thrust}");
    }
}
