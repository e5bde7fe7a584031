#!/usr/bin/env python3
"""A flight with MAVROS (ROS 1): parameters, streams, arming, OFFBOARD, two attitudes, HOLD, lost setpoints.

Not run by `cargo test`: it needs a sourced ROS workspace with MAVROS. Simulator and companion must be running, and the
simulator freshly started (not launched yet):

    cargo sitl
    cargo fly
    roslaunch mavros px4.launch fcu_url:=udp://:14540@
    python3 tests/clients/mavros.py

One line per check; the exit status is 1 if a check failed. The aircraft is left in HOLD. The topic setpoint_attitude/attitude
is flown as well where MAVROS's parameter setpoint_attitude/use_quaternion is true (px4_config.yaml has false).

Flown on 30 November 2026: MAVROS 1.21.0 on ROS 1 (roscpp 1.15.15, Debian 12, Python 3.11), `greylag fly --controller lqi`, the X8
in JSBSim 1.3.3 driven from Python over the link of sitl/PROTOCOL.md. MAVROS's fcu_url udp://@127.0.0.1:14550 works as well.

What a user of MAVROS meets:

- Modes have numbers, not names: see OFFBOARD below. /mavros/set_mode logs "MODE: Unsupported FCU".
- For such an autopilot MAVROS waits for an acknowledgement only where `confirmation` is 1. Otherwise it says success at once, also
  for what is refused, and logs "CMD: Unexpected command 176, result 1". set_message_interval is one of these: the companion
  streams no HIGHRES_IMU and no LOCAL_POSITION_NED, so imu/data_raw and local_position/* stay silent, whatever it answers.
- Setpoints of rates, positions, velocities and accelerations are refused with a text; of texts above 50 characters MAVROS shows
  the parts one by one. The battery is shown as 0 V, which is MAVROS's reading of "unknown".
- "Falling back to MISSION_ITEM" is harmless: there are no missions.
"""

import math
import sys
import threading
import time

import rospy
from geometry_msgs.msg import PoseStamped
from mavros_msgs.msg import AttitudeTarget, ParamValue, State, StatusText, Thrust, TimesyncStatus
from mavros_msgs.srv import CommandBool, CommandLong, MessageInterval, ParamGet, ParamPull, ParamSet, SetMode, WaypointPull
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import Imu

# custom_mode as PX4 numbers it: main mode << 16 | sub mode << 24. MAVROS has names for the modes of PX4 and ArduPilot only,
# and the companion is neither, so they are shown as CMODE(number) and set by a command instead of /mavros/set_mode.
OFFBOARD, HOLD = (6, 0), (4, 3)
DO_SET_MODE = 176
ATTITUDE_QUATERNION = 31
NEAR_DEG = 0.5

failed = []
heard = {}  # the newest message of each topic
texts = []
warnings = []
arrivals = []  # times of imu/data


def check(name, holds, detail=""):
    """Prints and counts one check."""
    print(f"{'pass' if holds else 'FAIL'}  {name}{f': {detail}' if detail else ''}", flush=True)
    if not holds:
        failed.append(name)
    return holds


def listen(topic, kind):
    """Keeps the newest message of a topic below /mavros."""
    rospy.Subscriber(f"/mavros/{topic}", kind, lambda message: heard.__setitem__(topic, message))


def until(holds, seconds):
    """Waits until `holds()` is true; whether it became true."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and not rospy.is_shutdown():
        if holds():
            return True
        time.sleep(0.02)
    return bool(holds())


def call(service, kind, *arguments):
    """Calls a service below /mavros; None if it failed."""
    try:
        rospy.wait_for_service(f"/mavros/{service}", 10.0)
        return rospy.ServiceProxy(f"/mavros/{service}", kind)(*arguments)
    except (rospy.ROSException, rospy.ServiceException) as error:
        print(f"      /mavros/{service}: {error}", flush=True)
        return None


def command_mode(mode):
    """Sets a mode by DO_SET_MODE; the result of the acknowledgement. Confirmation 1 makes MAVROS wait for it.

    MAVROS 1.21.0 may miss that it has come (the answer takes 0.1 ms here), and say after five seconds that the call failed,
    with the result that did come. So the result counts, here and for arming, not `success`.
    """
    answer = call("cmd/command", CommandLong, False, DO_SET_MODE, 1, 1.0, *map(float, mode), 0.0, 0.0, 0.0, 0.0)
    return None if answer is None else answer.result


def in_mode(mode):
    """Whether the heartbeat shows a mode."""
    return heard["state"].mode == f"CMODE({mode[0] << 16 | mode[1] << 24})"


def attitude():
    """Roll and pitch in degrees, nose up positive, of /mavros/imu/data."""
    q = heard["imu/data"].orientation
    roll = math.atan2(2.0 * (q.w * q.x + q.y * q.z), 1.0 - 2.0 * (q.x * q.x + q.y * q.y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (q.w * q.y - q.z * q.x))))
    # ROS's base_link is forward-left-up: a positive rotation about its y axis lowers the nose
    return math.degrees(roll), -math.degrees(pitch)


def orientation(aim, roll, pitch):
    """Writes a quaternion, forward-left-up in east-north-up, from degrees, nose up positive. Yaw, which is ignored, is 0."""
    x, y = math.radians(roll) / 2.0, -math.radians(pitch) / 2.0
    aim.w, aim.x = math.cos(x) * math.cos(y), math.sin(x) * math.cos(y)
    aim.y, aim.z = math.cos(x) * math.sin(y), -math.sin(x) * math.sin(y)


class Setpoints:
    """Publishes an attitude at 20 Hz on one of MAVROS's topics until it is stopped."""

    def __init__(self, topic, target=(0.0, 0.0)):
        self.topic, self.target, self.running = topic, target, True
        if topic == "setpoint_raw/attitude":
            self.raw = rospy.Publisher(f"/mavros/{topic}", AttitudeTarget, queue_size=1)
        else:
            self.pose = rospy.Publisher(f"/mavros/{topic}", PoseStamped, queue_size=1)
            self.thrust = rospy.Publisher("/mavros/setpoint_attitude/thrust", Thrust, queue_size=1)
        self.thread = threading.Thread(target=self._publish, daemon=True)
        self.thread.start()

    def _publish(self):
        rate = rospy.Rate(20)
        while self.running and not rospy.is_shutdown():
            now = rospy.Time.now()
            if self.topic == "setpoint_raw/attitude":
                message = AttitudeTarget(thrust=0.5)  # ignored unless GL_THRUST_SRC is 1
                message.type_mask = (
                    AttitudeTarget.IGNORE_ROLL_RATE | AttitudeTarget.IGNORE_PITCH_RATE | AttitudeTarget.IGNORE_YAW_RATE
                )
                message.header.stamp = now
                orientation(message.orientation, *self.target)
                self.raw.publish(message)
            else:
                # MAVROS sends a setpoint for each pair of about the same stamp
                pose, thrust = PoseStamped(), Thrust(thrust=0.5)
                pose.header.stamp = thrust.header.stamp = now
                orientation(pose.pose.orientation, *self.target)
                self.pose.publish(pose)
                self.thrust.publish(thrust)
            rate.sleep()

    def stop(self):
        """Ends the stream."""
        self.running = False
        self.thread.join()


def fly_attitude(topic, roll, pitch):
    """Streams an attitude, enters OFFBOARD, and waits until the attitude was near for two seconds."""
    stream = Setpoints(topic, (roll, pitch))
    time.sleep(1.0)
    result = command_mode(OFFBOARD)
    check(f"{topic}: OFFBOARD", result == 0 and until(lambda: in_mode(OFFBOARD), 3.0), f"result {result}, {heard['state'].mode}")
    since = None

    def settled():
        nonlocal since
        near = max(abs(a - b) for a, b in zip(attitude(), (roll, pitch))) <= NEAR_DEG
        since = (since or time.monotonic()) if near else None
        return since is not None and time.monotonic() - since >= 2.0

    held = until(settled, 20.0)
    check(f"{topic}: attitude {roll:g} / {pitch:g} deg", held, "%.2f / %.2f deg in imu/data" % attitude())
    return stream


def main():
    """Flies."""
    rospy.init_node("greylag_flight", disable_signals=False)
    for topic, kind in [("state", State), ("timesync_status", TimesyncStatus), ("imu/data", Imu)]:
        listen(topic, kind)
    rospy.Subscriber("/mavros/imu/data", Imu, lambda _: arrivals.append(time.monotonic()))
    rospy.Subscriber("/mavros/statustext/recv", StatusText, lambda message: texts.append(message.text))

    def note(log):
        if log.name == "/mavros" and log.level >= Log.WARN and log.msg not in warnings:
            warnings.append(log.msg)

    rospy.Subscriber("/rosout", Log, note)

    connected = until(lambda: "state" in heard and heard["state"].connected, 30.0)
    if not check("/mavros/state connected", connected):
        return
    check("starts disarmed in HOLD", not heard["state"].armed and in_mode(HOLD), heard["state"].mode)

    pulled = call("param/pull", ParamPull, True)
    check("param/pull", pulled and pulled.success and pulled.param_received > 0, pulled and f"{pulled.param_received} parameters")
    bank = call("param/get", ParamGet, "GL_BANK_MAX_DEG").value.real
    taken = call("param/set", ParamSet, "GL_BANK_MAX_DEG", ParamValue(real=bank - 5.0))
    check("param/set takes a value", taken and taken.success and taken.value.real == bank - 5.0)
    refused = call("param/set", ParamSet, "GL_BANK_MAX_DEG", ParamValue(real=500.0))
    now = call("param/get", ParamGet, "GL_BANK_MAX_DEG").value.real
    check("param/set: 500 deg of bank is refused", now == bank - 5.0, f"{refused and refused.value.real}, {now}")
    call("param/set", ParamSet, "GL_BANK_MAX_DEG", ParamValue(real=bank))

    mission = call("mission/pull", WaypointPull)
    check("mission/pull: an empty mission", mission and mission.success and mission.wp_received == 0)
    synced = until(lambda: "timesync_status" in heard, 5.0)
    check("timesync", synced, synced and "round trip %.1f ms" % heard["timesync_status"].round_trip_time_ms)
    answer = call("set_message_interval", MessageInterval, ATTITUDE_QUATERNION, 50.0)
    time.sleep(0.5)
    arrivals.clear()
    time.sleep(3.0)
    check("set_message_interval: 50 Hz", answer and answer.success and 40 < len(arrivals) / 3 < 60, f"{len(arrivals) / 3:.0f} Hz")

    named = call("set_mode", SetMode, 0, "OFFBOARD")
    print(f"note  /mavros/set_mode OFFBOARD by its name: mode_sent {named and named.mode_sent}", flush=True)
    result = command_mode(OFFBOARD)
    check("OFFBOARD is refused while disarmed", result not in (0, None) and in_mode(HOLD), f"result {result}")
    armed = call("cmd/arming", CommandBool, True)
    check("cmd/arming", armed and armed.result == 0 and until(lambda: heard["state"].armed, 3.0))
    result = command_mode(OFFBOARD)
    check("OFFBOARD is refused without setpoints", result not in (0, None) and in_mode(HOLD), f"result {result}")

    stream = fly_attitude("setpoint_raw/attitude", 20.0, 5.0)
    disarmed = call("cmd/arming", CommandBool, False)
    check("disarming in flight is refused", disarmed and disarmed.result != 0 and heard["state"].armed)
    result = command_mode(HOLD)
    check("HOLD", result == 0 and until(lambda: in_mode(HOLD), 3.0), f"result {result}, {heard['state'].mode}")
    stream.stop()
    if rospy.get_param("/mavros/setpoint_attitude/use_quaternion", False):
        fly_attitude("setpoint_attitude/attitude", -25.0, 3.0).stop()
        until(lambda: in_mode(HOLD), 3.0)
    else:
        print("note  setpoint_attitude/attitude is not flown: use_quaternion is false", flush=True)

    stream = fly_attitude("setpoint_raw/attitude", 20.0, 5.0)
    texts.clear()
    stream.stop()
    began = time.monotonic()
    lost = until(lambda: in_mode(HOLD), 3.0)
    check("lost setpoints lead to HOLD", lost, f"{time.monotonic() - began:.1f} s after the last; {texts}")
    level = until(lambda: abs(attitude()[0]) < 2.0, 10.0)
    check("wings level in HOLD, still armed", level and heard["state"].armed, "roll %.2f deg" % attitude()[0])
    stream = Setpoints("setpoint_raw/attitude")
    time.sleep(2.0)
    check("setpoints alone do not re-enter OFFBOARD", in_mode(HOLD))
    stream.stop()

    for words in warnings:
        print(f"note  mavros logged: {words}", flush=True)


main()
print(f"{len(failed)} checks failed" if failed else "all checks passed")
sys.exit(1 if failed else 0)
