#!/usr/bin/env bash
# JSBSim 1.3.3 (October 2026), and two packages that are built on it, jsbgym 0.4.3 (June 2026) and pathsim-flight 0.1.2 (May 2026): the time step has to be set before the aircraft is loaded. After load_model() set_dt() reaches the
# equations of motion and the propulsion, and not the control system: each actuator, filter, integrator, sensor and traverse keeps for ever the step that was in force when it was loaded, 1/120 s. Nothing is said. At 60 Hz all of these take
# twice their time, at 1000 Hz 0.12 of it: the flaps of a Cessna, 4.0 s by their file, take 8.0 and 0.48 s, and its aileron, limited to 90 deg/s, moves with 45 and 750 deg/s.
# Both packages load first and set the step then. jsbgym flies at 60 Hz by default, so that its agents learn on actuators of half the speed, and the policy meets others in JSBSim itself; pathsim-flight is right at its default of 120 Hz only.
# Why it matters: a servo's delay is what decides about the gains of an inner loop. Making the step finer, which is done to see whether a result depends on it, here makes the servos faster and the loop better; and the servo that is
# identified from such a simulation is not the one in the file.
# Source: FGFCSComponent's constructor copies GetChannelDeltaT() into `dt`; the coefficients of FGFilter, FGActuator and FGSensor follow from it there, rate limits, FGPID and FGKinemat read it each frame. FGFDMExec::Setdt() sets its own dT.
# jsbgym: Simulation.initialise(); pathsim-flight: JSBSimWrapper.init_fdm(). The documentation: "Sets the integration time step for the simulation executive." (JSBSim's own program sets it before loading.)
# Instead: set_dt() first, then load_model(), in an executive for each step; `simulation/channel-dt` does not help, it shows the new step. In the packages 120 Hz and no other rate.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv v && v/bin/pip -q install --no-compile jsbsim==1.3.3 numpy==2.2.6 matplotlib==3.10.3 gymnasium==1.4.0 pathsim==0.27.1 scipy==1.15.3
v/bin/pip -q install --no-compile --no-deps jsbgym==0.4.3 pathsim-flight==0.1.2
MPLCONFIGDIR="$folder" MPLBACKEND=Agg OPENBLAS_NUM_THREADS=1 v/bin/python - <<'PYTHON' 2>/dev/null | grep '^[A-Za-z].* Hz\|^Versions\|^By the file'
import math
from importlib.metadata import version
from pathlib import Path
from xml.etree import ElementTree

import jsbsim
from jsbgym.aircraft import Aircraft
from jsbgym.simulation import Simulation
from pathsim_flight.jsbsim import JSBSimWrapper

print("Versions: jsbsim", version("jsbsim"), "- jsbgym", version("jsbgym"), "- pathsim-flight", version("pathsim-flight"), flush=True)
control = ElementTree.parse(Path(jsbsim.__file__).parent / "aircraft/c172x/c172x.xml").getroot().find("flight_control")
travel = sum(float(setting.findtext("time")) for setting in control.findall(".//kinematic[@name='fcs/flaps-control']/traverse/setting"))
limit = math.degrees(float(control.findtext(".//actuator[@name='fcs/left-aileron-actuator']/rate_limit")))
print(f"By the file of the aircraft the flaps take {travel:.2f} s and the aileron moves with {limit:.0f} deg/s at most", flush=True)

def executive(rate, first):
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    if first == "step":
        fdm.set_dt(1 / rate)
    assert fdm.load_model("c172x")
    fdm.set_dt(1 / rate)
    fdm["ic/h-sl-ft"], fdm["ic/vc-kts"] = 3000, 90
    assert fdm.run_ic()
    return fdm

def measured(fdm):
    """Seconds from the command to full flaps, and the fastest that the aileron moves; by the simulation's own clock."""
    for _ in range(round(0.5 / fdm.get_delta_t())):
        fdm.run()
    fdm["fcs/flap-cmd-norm"], fdm["fcs/aileron-cmd-norm"] = 1, 1
    begin, aileron, fastest = fdm.get_sim_time(), fdm["fcs/left-aileron-pos-rad"], 0.0
    while fdm["fcs/flap-pos-deg"] < 30 - 1e-6:
        fdm.run()
        fastest = max(fastest, (fdm["fcs/left-aileron-pos-rad"] - aileron) / fdm.get_delta_t())
        aileron = fdm["fcs/left-aileron-pos-rad"]
        assert fdm.get_sim_time() - begin < 30
    return fdm.get_sim_time() - begin, math.degrees(fastest)

def report(name, rate, fdm, factor):
    assert abs(fdm.get_delta_t() * rate - 1) < 1e-9 and abs(fdm["simulation/channel-dt"] * rate - 1) < 1e-9
    flaps, speed = measured(fdm)
    print(f"{name:46} at {rate:4.0f} Hz: the flaps take {flaps:5.2f} s, the aileron moves with {speed:4.0f} deg/s", flush=True)
    assert abs(flaps - factor * travel) < 2.5 / rate + 0.01 and abs(speed * factor / limit - 1) < 0.01

for rate in (30, 60, 120, 250, 1000):
    report("JSBSim, step before the aircraft", rate, executive(rate, "step"), 1)
for rate in (30, 60, 120, 250, 1000):
    report("JSBSim, aircraft before the step", rate, executive(rate, "aircraft"), 120 / rate)
cessna = Aircraft("c172x", "c172p", "C172", 120)
report("jsbgym, Simulation() as its environments use it", 60, Simulation(aircraft=cessna, allow_flightgear_output=False).jsbsim, 2)
for rate in (120, 400):
    report("pathsim-flight, JSBSimWrapper(T=1/rate)", rate, JSBSimWrapper(T=1 / rate, aircraft_model="c172x", trim_airspeed=90, trim_altitude=3000).fdm, 120 / rate)
PYTHON
