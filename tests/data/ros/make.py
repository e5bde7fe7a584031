"""Writes the sample bags beside this file from ../odd_logs/good.csv, by libraries that share nothing with the reader.

    pip install mcap==1.6.0 rosbags==0.11.9 scipy==1.17.1 numpy==2.4.6
    python make.py

The definitions have the field names of MAVROS, the common interfaces of ROS 2 and px4_msgs, no more fields than the
test needs.
"""

from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

HERE = Path(__file__).parent
ROWS = np.genfromtxt(HERE / "../odd_logs/good.csv", delimiter=",", names=True)[:800:4]
START_S = 1_760_000_000
PX4 = {
    "VehicleAttitude": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\nuint8 quat_reset_counter\n",
    "VehicleAngularVelocity": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\nfloat32[3] xyz_derivative\n",
    "VehicleAcceleration": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\n",
    "AirspeedValidated": "uint32 MESSAGE_VERSION = 1\nuint64 timestamp\nfloat32 indicated_airspeed_m_s\n"
    "float32 true_airspeed_m_s\n",
    "VehicleLocalPosition": "uint64 timestamp\nuint64 timestamp_sample\nbool xy_valid\nfloat32 vx\nfloat32 vy\nfloat32 vz\n",
    "VehicleGlobalPosition": "uint64 timestamp\nfloat64 lat\nfloat64 lon\nfloat32 alt\n",
    "VehicleTorqueSetpoint": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\n",
    "VehicleThrustSetpoint": "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] xyz\n",
    "VehicleStatus": "uint64 timestamp\nuint8 vehicle_type\nbool is_vtol\nuint8 system_type\n",
}
MAVROS = {
    "VfrHud": "std_msgs/Header header\nfloat32 airspeed\nfloat32 groundspeed\nint16 heading\nfloat32 throttle\n"
    "float32 altitude\nfloat32 climb\n",
    "ActuatorControl": "uint8 GROUP_FLIGHT = 0\nstd_msgs/Header header\nuint8 group_mix\nfloat32[8] controls\n",
    "RCOut": "std_msgs/Header header\nuint16[] channels\n",
    "ExtendedState": "std_msgs/Header header\nuint8 vtol_state\nuint8 landed_state\n",
}


def store():
    types = get_typestore(Stores.ROS2_JAZZY)
    for package, definitions in (("px4_msgs", PX4), ("mavros_msgs", MAVROS)):
        for name, text in definitions.items():
            types.register(get_types_from_msg(text, f"{package}/msg/{name}"))
    return types


TYPES = store()


class Bag:
    def __init__(self, name, compression, chunk_size, little=True, chunking=True):
        self.writer = Writer(str(HERE / name), compression=compression, chunk_size=chunk_size, use_chunking=chunking)
        self.writer.start(profile="ros2", library="make.py")
        self.channels = {}
        self.little = little

    def channel(self, topic, kind):
        if topic not in self.channels:
            text, _ = TYPES.generate_msgdef(kind, ros_version=2)
            schema = self.writer.register_schema(kind, "ros2msg", text.encode())
            self.channels[topic] = self.writer.register_channel(topic, "cdr", schema)
        return self.channels[topic]

    def write(self, topic, kind, time_ns, fields):
        message = TYPES.types[kind](**fields)
        data = bytes(TYPES.serialize_cdr(message, kind, little_endian=self.little))
        log_ns = time_ns + 3_000_000
        self.writer.add_message(self.channel(topic, kind), log_time=log_ns, publish_time=log_ns, data=data)

    def close(self):
        self.writer.finish()


def floats(*values):
    return np.array(values, dtype=np.float32)


def px4(bag, row):
    us = START_S * 1_000_000 + round(row["time_s"] * 1e6)
    stamp = {"timestamp": us + 200}
    both = {**stamp, "timestamp_sample": us}
    q = Rotation.from_euler("ZYX", [row["yaw_rad"], row["pitch_rad"], row["roll_rad"]]).as_quat(scalar_first=True)
    zeros = floats(0, 0, 0)
    rates = floats(row["p_radps"], row["q_radps"], row["r_radps"])
    force = floats(row["ax_mps2"], row["ay_mps2"], row["az_mps2"])
    # the stamp of these is the sample's, they have no other
    alone = {"timestamp": us}
    for topic, kind, fields in (
        ("vehicle_attitude", "VehicleAttitude", {**both, "q": floats(*q), "quat_reset_counter": 0}),
        ("vehicle_angular_velocity", "VehicleAngularVelocity", {**both, "xyz": rates, "xyz_derivative": zeros}),
        ("vehicle_acceleration", "VehicleAcceleration", {**both, "xyz": force}),
        ("airspeed_validated", "AirspeedValidated",
         {**alone, "indicated_airspeed_m_s": 0.0, "true_airspeed_m_s": row["airspeed_mps"]}),
        ("vehicle_local_position", "VehicleLocalPosition",
         {**both, "xy_valid": True, "vx": row["vn_mps"], "vy": row["ve_mps"], "vz": row["vd_mps"]}),
        ("vehicle_global_position", "VehicleGlobalPosition",
         {**alone, "lat": 48.0, "lon": 11.0, "alt": row["altitude_m"]}),
        ("vehicle_torque_setpoint", "VehicleTorqueSetpoint",
         {**both, "xyz": floats(row["aileron_cmd"], -row["elevator_cmd"], 0)}),
        ("vehicle_thrust_setpoint", "VehicleThrustSetpoint", {**both, "xyz": floats(row["throttle_cmd"], 0, 0)}),
        ("vehicle_status_v1", "VehicleStatus", {**alone, "vehicle_type": 2, "is_vtol": False, "system_type": 1}),
    ):
        bag.write(f"/fmu/out/{topic}", f"px4_msgs/msg/{kind}", us * 1000, fields)


def make(kind, **fields):
    return TYPES.types[kind](**fields)


def mavros(bag, row, namespace=""):
    ns = START_S * 1_000_000_000 + round(row["time_s"] * 1e9)
    time = make("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
    header = make("std_msgs/msg/Header", stamp=time, frame_id="base_link")
    vector = lambda *v: make("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, v))))
    body = Rotation.from_euler("ZYX", [row["yaw_rad"], row["pitch_rad"], row["roll_rad"]]).as_matrix()
    to_enu = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    quat = Rotation.from_matrix(to_enu @ body @ np.diag([1, -1, -1])).as_quat()
    density = (1 - 2.25577e-5 * row["altitude_m"]) ** 4.25588
    nine = np.zeros(9)
    for topic, kind, fields in (
        ("imu/data", "sensor_msgs/msg/Imu", {
            "orientation": make("geometry_msgs/msg/Quaternion", **dict(zip("xyzw", map(float, quat)))),
            "orientation_covariance": nine,
            "angular_velocity": vector(row["p_radps"], -row["q_radps"], -row["r_radps"]),
            "angular_velocity_covariance": nine,
            "linear_acceleration": vector(row["ax_mps2"], -row["ay_mps2"], -row["az_mps2"]),
            "linear_acceleration_covariance": nine}),
        ("vfr_hud", "mavros_msgs/msg/VfrHud", {
            "airspeed": row["airspeed_mps"] * density**0.5, "groundspeed": 0.0, "heading": 0,
            "throttle": row["throttle_cmd"], "altitude": row["altitude_m"], "climb": -row["vd_mps"]}),
        ("local_position/velocity_local", "geometry_msgs/msg/TwistStamped", {
            "twist": make("geometry_msgs/msg/Twist", linear=vector(row["ve_mps"], row["vn_mps"], -row["vd_mps"]),
                          angular=vector(0, 0, 0))}),
        ("target_actuator_control", "mavros_msgs/msg/ActuatorControl", {
            "group_mix": 0,
            "controls": floats(row["aileron_cmd"], -row["elevator_cmd"], 0, row["throttle_cmd"], 0, 0, 0, 0)}),
        ("rc/out", "mavros_msgs/msg/RCOut", {
            "channels": np.array([1500, 1500, round(1000 + 1000 * row["throttle_cmd"])], dtype=np.uint16)}),
        ("extended_state", "mavros_msgs/msg/ExtendedState", {"vtol_state": 0, "landed_state": 2}),
    ):
        bag.write(f"{namespace}/mavros/{topic}", kind, ns, {"header": header, **fields})


def image(bag, row):
    """A topic that nobody asks for, larger than a chunk."""
    ns = START_S * 1_000_000_000 + round(row["time_s"] * 1e9)
    time = make("builtin_interfaces/msg/Time", sec=ns // 10**9, nanosec=ns % 10**9)
    header = make("std_msgs/msg/Header", stamp=time, frame_id="camera")
    fields = {"header": header, "height": 1000, "width": 1500, "encoding": "mono8", "is_bigendian": 0, "step": 1500,
              "data": np.zeros(1_500_000, dtype=np.uint8)}
    bag.write("/camera/image_raw", "sensor_msgs/msg/Image", ns, fields)


def main():
    bag = Bag("px4.zstd.mcap", CompressionType.ZSTD, 16_384)
    for i, row in enumerate(ROWS):
        if i % 60 == 10:
            image(bag, row)
        px4(bag, row)
    bag.close()
    # big-endian, which no computer writes that one meets, but the format allows
    for name, compression, little in (("mavros.lz4.mcap", CompressionType.LZ4, True),
                                      ("mavros_big_endian.zstd.mcap", CompressionType.ZSTD, False)):
        bag = Bag(name, compression, 32_768, little=little)
        for row in ROWS if little else ROWS[:30]:
            mavros(bag, row)
        bag.close()
    bag = Bag("two_vehicles.plain.mcap", CompressionType.NONE, 4_096)
    for row in ROWS[:10]:
        mavros(bag, row, "/uav1")
        mavros(bag, row, "/uav2")
    bag.close()
    bag = Bag("px4_no_chunks.mcap", CompressionType.NONE, 4_096, chunking=False)
    for row in ROWS[:12]:
        px4(bag, row)
    bag.close()


main()
