//! Derivatives of AVL, OptVL, AeroSandbox and XFLR5 become a model: values, signs, axes, widths, what is refused and what is not
//! believed.

use greylag::model::GreyBox;
use greylag::model::derivatives::widths::{self, Tool};
use greylag::model::derivatives::{Beside, DerivativesError, Read, read, reference};
use greylag::model::textbook::{Measures, Tail};

/// What AVL's ST writes of an aircraft of the size of the Aerosonde, at `alpha` (degrees).
fn text(alpha: f64) -> String {
    format!(
        " ---------------------------------------------------------------
 Vortex Lattice Output -- Total Forces

 Configuration: own aircraft = a test
     # Surfaces =   5
  Sref = 0.55000       Cref = 0.18994       Bref =  2.8956
  Xref = 0.10000       Yref =  0.0000       Zref =  0.0000

 Standard axis orientation,  X fwd, Z down

  Alpha = {alpha:9.5}     pb/2V =  -0.00000     p'b/2V =  -0.00000
  Beta  =   0.00000     qc/2V =   0.00000
  Mach  =     0.000     rb/2V =  -0.00000     r'b/2V =  -0.00000

  CLtot =   0.52500
  CDtot =   0.01290
  Cmtot =  -0.12000
   e    =    0.9800

   aileron         =   0.00000
   elevator        =   0.00000
   rudder          =   0.00000
 ---------------------------------------------------------------
 Stability-axis derivatives...

                             alpha                beta
                  ----------------    ----------------
 z' force CL |    CLa =   5.600000    CLb =   0.000000
 y  force CY |    CYa =   0.000000    CYb =  -0.300000
 x' mom.  Cl'|    Cla =   0.000000    Clb =  -0.100000
 y  mom.  Cm |    Cma =  -2.700000    Cmb =   0.000000
 z' mom.  Cn'|    Cna =   0.000000    Cnb =   0.080000

                     roll rate  p'      pitch rate  q'        yaw rate  r'
                  ----------------    ----------------    ----------------
 z' force CL |    CLp =   0.000000    CLq =   8.000000    CLr =   0.000000
 y  force CY |    CYp =   0.050000    CYq =   0.000000    CYr =   0.200000
 x' mom.  Cl'|    Clp =  -0.550000    Clq =   0.000000    Clr =   0.150000
 y  mom.  Cm |    Cmp =   0.000000    Cmq = -40.000000    Cmr =   0.000000
 z' mom.  Cn'|    Cnp =  -0.040000    Cnq =   0.000000    Cnr =  -0.080000

                  aileron      d01     elevator     d02     rudder       d03     flap         d04
                  ----------------    ----------------    ----------------    ----------------
 z' force CL |  CLd01 =   0.000000  CLd02 =   0.010000  CLd03 =   0.000000  CLd04 =   0.020000
 y  force CY |  CYd01 =   0.001000  CYd02 =   0.000000  CYd03 =  -0.003000  CYd04 =   0.000000
 x' mom.  Cl'|  Cld01 =  -0.003000  Cld02 =   0.000000  Cld03 =  -0.000100  Cld04 =   0.000000
 y  mom.  Cm |  Cmd01 =   0.000000  Cmd02 =  -0.030000  Cmd03 =   0.000000  Cmd04 =   0.000000
 z' mom.  Cn'|  Cnd01 =   0.000200  Cnd02 =   0.000000  Cnd03 =   0.001200  Cnd04 =   0.000000
 Trefftz drag| CDffd01 =   0.000000 CDffd02 =   0.000000
 span eff.   |   ed01 =   0.000000    ed02 =   0.000000

 Neutral point  Xnp =   0.191000
 Clb Cnr / Clr Cnb  =   0.666667    (  > 1 if spirally stable )
"
    )
}

fn beside() -> Beside {
    let measures = Measures {
        name: "Own".into(),
        mass: 11.0,
        span: 2.9,
        area: 0.55,
        tail: Tail::Conventional,
        rudder: Some(0.4363),
        travel: 0.4363,
        static_thrust: 60.0,
        pitch_speed: 50.0,
    };
    Beside { measures, metres: 1.0, radians: 1f64.to_radians() }
}

fn model(read: &Read) -> GreyBox {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("airframe.toml"), &read.airframe).unwrap();
    std::fs::write(folder.path().join("model.toml"), &read.model).unwrap();
    GreyBox::load(&folder.path().join("model.toml")).unwrap()
}

fn close(model: &GreyBox, name: &str, value: f64) {
    let own = model.coefficients().iter().find(|c| c.name == name).unwrap();
    // five decimals are written
    assert!((own.value - value).abs() < 2e-5, "{name}: {} for {value}", own.value);
}

#[test]
fn at_no_incidence_the_derivatives_are_the_coefficients() {
    let read = read(&text(0.0), &beside()).unwrap();
    let model = model(&read);
    let degree = 1f64.to_radians();
    for (name, value) in [
        ("lift_linear.CL0", 0.525),
        ("lift_linear.CLalpha", 5.6),
        ("lift_linear.CLq", 8.0),
        ("lift_linear.CLde", 0.01 / degree),
        ("pitch_linear.Cm0", -0.12),
        ("pitch_linear.Cmalpha", -2.7),
        ("pitch_linear.Cmq", -40.0),
        ("pitch_linear.Cmde", -0.03 / degree),
        ("side_force_linear.CYbeta", -0.3),
        ("roll_linear.Clbeta", -0.1),
        ("roll_linear.Clp", -0.55),
        ("roll_linear.Clr", 0.15),
        ("yaw_linear.Cnbeta", 0.08),
        ("yaw_linear.Cnr", -0.08),
        // AVL's aileron is positive with the right one down, its rudder to the right
        ("roll_linear.Clda", 0.003 / degree),
        ("yaw_linear.Cnda", -0.0002 / degree),
        ("rudder_linear.CYdr", 0.003 / degree),
        ("rudder_linear.Cndr", -0.0012 / degree),
    ] {
        close(&model, name, value);
    }
    let width = |name: &str| {
        let own = model.coefficients().iter().find(|c| c.name == name).unwrap();
        own.width() / own.value.abs()
    };
    for (full, name) in
        [("lift_linear.CLalpha", "CLalpha"), ("roll_linear.Clp", "Clp"), ("yaw_linear.Cnr", "Cnr")]
    {
        // three digits are written
        assert!((width(full) - widths::of(Tool::Avl, name).unwrap()).abs() < 3e-3, "{name}");
    }
    assert!(read.warnings.is_empty(), "{:?}", read.warnings);
    let said = read.notes.join("\n");
    assert!(said.contains("aileron of the file is reversed in sign"), "{said}");
    assert!(said.contains("rudder of the file is reversed in sign"), "{said}");
    assert!(
        said.contains("the control flap is left out") && !said.contains("elevator of"),
        "{said}"
    );
}

/// In stability axes the same rolling damping is, in body axes, a rolling and a yawing one: R(α) D R(α)ᵀ.
#[test]
fn stability_axes_are_turned_into_body_axes() {
    let model = model(&read(&text(6.0), &beside()).unwrap());
    let (s, c) = 6f64.to_radians().sin_cos();
    let (lp, lr, np, nr) = (-0.55, 0.15, -0.04, -0.08);
    close(&model, "roll_linear.Clp", c * c * lp - s * c * (lr + np) + s * s * nr);
    close(&model, "roll_linear.Clr", c * c * lr + s * c * (lp - nr) - s * s * np);
    close(&model, "yaw_linear.Cnp", c * c * np + s * c * (lp - nr) - s * s * lr);
    close(&model, "yaw_linear.Cnr", c * c * nr + s * c * (lr + np) + s * s * lp);
    close(&model, "lift_linear.CL0", 0.525 - 5.6 * 6f64.to_radians());
}

#[test]
fn what_is_missing_or_no_number_is_named() {
    let without = text(0.0).replace("CLa =", "XXa =");
    let error = read(&without, &beside()).unwrap_err();
    assert!(
        error.to_string().contains("no CLa") && error.to_string().contains("command ST"),
        "{error}"
    );
    let stars = text(0.0).replace("Cmq = -40.000000", "Cmq = **********");
    assert!(
        matches!(read(&stars, &beside()), Err(DerivativesError::Number { name, .. }) if name == "Cmq")
    );
    let flat = text(0.0).replace("Sref = 0.55000", "Sref = 0.00000");
    assert_eq!(read(&flat, &beside()).unwrap_err(), DerivativesError::Reference);
    let bare = text(0.0).replace("rudder       d03", "vane         d03");
    let read = read(&bare, &beside()).unwrap();
    assert!(read.notes.iter().any(|n| n.contains("is called rudder")), "{:?}", read.notes);
}

/// What OptVL 2.5.0 and AeroSandbox 4.2.10 computed (tests/derivatives/tools.py).
fn computed(name: &str) -> String {
    let path = format!("{}/tests/data/derivatives/{name}.json", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(path).unwrap()
}

fn value(model: &GreyBox, name: &str) -> f64 {
    model.coefficients().iter().find(|c| c.name == name).unwrap().value
}

/// The trainer's derivatives that every tool must agree on in sign, and in size to a factor of two.
const SIGNS: [(&str, f64); 10] = [
    ("lift_linear.CLalpha", 4.9),
    ("pitch_linear.Cmalpha", -1.1),
    ("pitch_linear.Cmq", -15.0),
    ("roll_linear.Clbeta", -0.05),
    ("roll_linear.Clp", -0.5),
    ("roll_linear.Clr", 0.13),
    ("roll_linear.Clda", 0.3),
    ("yaw_linear.Cnbeta", 0.06),
    ("yaw_linear.Cnr", -0.07),
    ("rudder_linear.Cndr", -0.056),
];

#[test]
fn optvls_result_is_in_body_axes_by_a_radian_with_our_signs() {
    let read = read(&computed("trainer-optvl"), &beside()).unwrap();
    assert_eq!(read.tool, Tool::OptVl);
    assert!(read.warnings.is_empty(), "{:?}", read.warnings);
    let model = model(&read);
    // OptVL's own body-axis derivatives by p and r at 3 degrees: get_body_axis_derivs()
    close(&model, "roll_linear.Clp", -0.493_856);
    close(&model, "roll_linear.Clr", 0.126_960);
    close(&model, "yaw_linear.Cnp", -0.062_759);
    close(&model, "yaw_linear.Cnr", -0.064_439);
    // get_control_stab_derivs() has them about body axes too, by a degree: dCl/daileron, dCn/drudder
    close(&model, "roll_linear.Clda", 0.005_371_679_786_503_71f64.to_degrees());
    close(&model, "rudder_linear.Cndr", -0.000_977_511_311_930_982f64.to_degrees());
    close(&model, "pitch_linear.Cmde", -0.030_271_617_678_079_15f64.to_degrees());
    for (name, about) in SIGNS {
        let ratio = value(&model, name) / about;
        assert!((0.5..2.0).contains(&ratio), "{name}: {ratio}");
    }
}

/// A tool may be wrong by its width; it may not be of another sign.
#[test]
fn aerosandboxs_buildup_is_read_with_its_controls() {
    let read = read(&computed("trainer-aerobuildup"), &beside()).unwrap();
    assert_eq!(read.tool, Tool::AeroBuildup);
    let model = model(&read);
    for (name, about) in SIGNS {
        let ratio = value(&model, name) / about;
        assert!((0.4..4.0).contains(&ratio), "{name}: {ratio}");
    }
    // an aileron of AeroSandbox rolls left, its rudder yaws right
    assert!(read.notes.iter().any(|n| n.contains("aileron of the file is reversed in sign")));
}

#[test]
fn what_a_method_does_not_compute_is_named_and_not_taken() {
    let lattice = read(&computed("trainer-vortexlatticemethod"), &beside()).unwrap();
    let said = lattice.warnings.join("\n");
    for part in ["Clda is 0", "Cmde is 0", "Cndr is 0", "ignores deflected surfaces"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(said.contains("from OptVL or AVL") && !said.contains("AeroBuildup"), "{said}");
    let textbook = model(&lattice);
    assert!(value(&textbook, "pitch_linear.Cmde") < -0.3, "the textbook's elevator stands in");
    let line = read(&computed("trainer-liftingline"), &beside()).unwrap();
    let said = line.warnings.join("\n");
    for part in ["Clp = -0.00", "with CLalpha", "Cmq = ", "does not model rotation"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(value(&model(&line), "roll_linear.Clp") < -0.2);
    assert!(said.lines().count() <= 3, "{said}");
}

/// AeroSandbox 4.2.10 has no pitching moment of a flapped section (findings/aerosandbox-elevon-moment.sh), OptVL has.
#[test]
fn aerosandboxs_elevons_are_not_believed_on_a_flying_wing() {
    let mut wing = beside();
    (wing.measures.tail, wing.measures.rudder) = (Tail::FlyingWing, None);
    let textbook = model(&read(&computed("trainer-vortexlatticemethod"), &wing).unwrap());
    for (name, tool) in [("aerobuildup", "AeroBuildup"), ("liftingline", "lifting line")] {
        let read = read(&computed(&format!("trainer-{name}")), &wing).unwrap();
        let own: Vec<_> = read.warnings.iter().filter(|w| w.starts_with("Cmde = ")).collect();
        assert_eq!(own.len(), 1, "{:?}", read.warnings);
        let words = [tool, "is not used", "wrong sign", "from OptVL or AVL"];
        assert!(words.iter().all(|w| own[0].contains(w)), "{own:?}");
        let model = model(&read);
        for name in ["pitch_linear.Cmde", "lift_linear.CLde"] {
            assert_eq!(value(&model, name), value(&textbook, name), "{name}");
        }
        assert!(value(&model, "lift_linear.CLalpha") != value(&textbook, "lift_linear.CLalpha"));
    }
    let optvl = read(&computed("trainer-optvl"), &wing).unwrap();
    close(&model(&optvl), "pitch_linear.Cmde", -0.030_271_617_678_079_15f64.to_degrees());
}

/// The moment of each control is turned to our sign, so that a wrong one shows in the force.
#[test]
fn a_control_whose_force_and_moment_contradict_each_other_is_named() {
    let with = |old: &str, new: &str| {
        assert!(text(0.0).contains(old));
        read(&text(0.0).replace(old, new), &beside()).unwrap().warnings.join("\n")
    };
    let said = with("Cmd02 =  -0.030000", "Cmd02 =   0.030000");
    assert!(said.contains("CLde = -0.573 and Cmde = -1.719 have the same sign"), "{said}");
    // an elevon at half a chord, taken for an elevator
    let said = with("Cmd02 =  -0.030000", "Cmd02 =  -0.005000");
    assert!(said.contains("Cmde = -0.286") && said.contains("--tail flying-wing"), "{said}");
    let said = with("Cnd03 =   0.001200", "Cnd03 =  -0.001200");
    assert!(said.contains("CYdr = -0.172 and Cndr = -0.0688 have the same sign"), "{said}");
}

#[test]
fn json_without_a_method_or_a_number_is_refused_by_name() {
    let text = computed("trainer-aerobuildup");
    let refused = |text: String| read(&text, &beside()).unwrap_err().to_string();
    let nameless = refused(text.replace("AeroSandbox 4.2.10 AeroBuildup", "mine"));
    assert!(nameless.contains("'mine'") && nameless.contains("LiftingLine"), "{nameless}");
    assert!(refused(text.replace("\"CLq\"", "\"XLq\"")).contains("no CLq"));
    assert!(refused(text.replace("\"alpha_deg\"", "\"a\"")).contains("\"alpha_deg\""));
    assert!(refused("{".into()).contains("JSON"));
    let nan = text.replacen("\"CLq\": ", "\"CLq\": NaN, \"q\": ", 1);
    assert!(refused(nan).contains("JSON"));
    assert_eq!(
        reference("{\"Sref\": 0, \"Cref\": 1, \"Bref\": 1}"),
        Err(DerivativesError::Reference)
    );
}

/// The form of XFLR5's log, with numbers of our own.
const XFLR5: &str = "Sref = 0.45
Cref = 0.25
Bref = 1.8
   Mass=       2.400 kg
    CoG_x=      0.0800 m
    CoG_z=      0.0000 m
      Searching for zero-moment angle... Alpha=2.00000\u{b0}
      Calculating speed to balance the weight...VInf = 14.00000 m/s

      Longitudinal derivatives
      Xu=   -0.028858         Cxu=   -0.039385
      Zw=     -3.1536         CLa=      4.9000
      Zq=    -0.44812         CLq=      8.9000
      Mw=   -0.081849         Cma=    -1.00000
      Mq=   -0.098813         Cmq=    -14.9000
      Neutral Point position=   0.13100 m

      Lateral derivatives
      Yv=    -0.61866         CYb=    -0.16000
      Yp=    0.011975         CYp=   -0.068000
      Yr=     0.26989         CYr=     0.17000
      Lv=   -0.044646         Clb=   -0.047000
      Lp=   -0.090387         Clp=    -0.49000
      Lr=    0.019467         Clr=     0.15000
      Nv=     0.21312         Cnb=     0.06100
      Np=   -0.037193         Cnp=   -0.040000
      Nr=   -0.097294         Cnr=    -0.06900

      Control derivatives
      Zde=     -5.8507        CZde=    -0.58000
      Lde= -2.4741e-08        CLde= -4.9226e-09
      Mde=     -1.9823        CMde=    -1.73000
      Nde= -3.8288e-06        CNde= -7.6181e-07
";

#[test]
fn xflr5s_log_is_read_with_the_lift_of_its_speed() {
    let read = read(XFLR5, &beside()).unwrap();
    assert_eq!(read.tool, Tool::Xflr5);
    let model = model(&read);
    // m g / (q S) at 14 m/s, less the slope's share of 2 degrees
    let lift = 2.4 * 9.80665 / (0.5 * 1.225 * 196.0 * 0.45);
    assert!((value(&model, "lift_linear.CL0") - (lift - 4.9 * 2f64.to_radians())).abs() < 1e-3);
    close(&model, "pitch_linear.Cmde", -1.73);
    close(&model, "lift_linear.CLde", 0.58);
    assert!(value(&model, "roll_linear.Clp") < -0.48);
    let said = read.notes.join("\n");
    assert!(
        said.contains("taken for the elevator") && said.contains("is called aileron"),
        "{said}"
    );
    let bare = XFLR5.replace("Sref", "Xref");
    assert!(reference(&bare).unwrap_err().to_string().contains("Sref = 0.45"));
}
