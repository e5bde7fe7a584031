//! Derivatives as AVL writes them become a model: values, signs, axes, widths, and what is refused.

use greylag::model::GreyBox;
use greylag::model::avl::{AvlError, Beside, Read, read};
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
    assert!((width("lift_linear.CLalpha") - 0.05).abs() < 1e-3);
    assert!((width("roll_linear.Clp") - 0.2).abs() < 1e-3);
    assert!((width("yaw_linear.Cnr") - 0.5).abs() < 1e-3);
    let said = read.notes.join("\n");
    assert!(said.contains("aileron of the file is turned round"), "{said}");
    assert!(said.contains("rudder of the file is turned round"), "{said}");
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
    assert!(matches!(read(&stars, &beside()), Err(AvlError::Number { name, .. }) if name == "Cmq"));
    let flat = text(0.0).replace("Sref = 0.55000", "Sref = 0.00000");
    assert_eq!(read(&flat, &beside()).unwrap_err(), AvlError::Reference);
    let bare = text(0.0).replace("rudder       d03", "vane         d03");
    let read = read(&bare, &beside()).unwrap();
    assert!(read.notes.iter().any(|n| n.contains("is called rudder")), "{:?}", read.notes);
}
