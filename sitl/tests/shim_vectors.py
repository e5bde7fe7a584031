#!/usr/bin/env python3
"""Regenerates shim_vectors.txt: MAVLink frames of pymavlink, which the shim's codec must reproduce.

    python3 -m venv venv && venv/bin/pip install pymavlink==2.4.50
    venv/bin/python sitl/tests/shim_vectors.py > sitl/tests/shim_vectors.txt

Every line is a name and a frame in hexadecimal. The values are repeated in shim/codec.rs.
"""

import os

os.environ["MAVLINK20"] = "1"

from pymavlink.dialects.v10 import ardupilotmega as one  # noqa: E402
from pymavlink.dialects.v20 import ardupilotmega as two  # noqa: E402
from pymavlink.dialects.v20 import development as newer  # noqa: E402


def messages(m):
    """One message of each kind. Fractions are exact in binary, so both codecs have equal values."""
    ramp16 = [0.25, -0.5, 0.75] + [0.0] * 13
    ramp32 = [0.125 * i - 1.0 for i in range(32)]
    return [
        ("heartbeat", m.MAVLink_heartbeat_message(1, 8, 129, 393216, 4, 3)),
        ("sys_status", m.MAVLink_sys_status_message(
            0x3B, 0x3A, 0x39, 501, 12600, -1, -1, 2, 3, 4, 5, 6, 7, 8, 9, 10)),
        ("gps_raw_int", m.MAVLink_gps_raw_int_message(
            1234567890123, 3, 468000001, -71234567, 600123, 80, 120, 1667, 35999, 12,
            600124, 5, 6, 7, 8, 9)),
        ("attitude_quaternion", m.MAVLink_attitude_quaternion_message(
            4000000001, 0.5, -0.25, 0.125, 0.75, 1.5, -2.5, 3.5, [0.0, 0.0, 0.0, 0.0])),
        ("global_position_int", m.MAVLink_global_position_int_message(
            77, 468000001, -71234567, 600123, -1000, 1667, -200, 35, 35999)),
        ("vfr_hud", m.MAVLink_vfr_hud_message(16.625, 17.5, 359, 100, 600.5, -0.75)),
        ("hil_actuator_controls", m.MAVLink_hil_actuator_controls_message(
            123456789012345, ramp16, 128, 0)),
        ("highres_imu", m.MAVLink_highres_imu_message(
            10000, 0.5, -0.25, -9.75, 0.125, -0.375, 0.625, 1.0, 2.0, 3.0, 943.25, 4.0, 600.5,
            11.5, 0x1A3F, 0)),
        ("highres_imu_extension", m.MAVLink_highres_imu_message(
            10000, 0.5, -0.25, -9.75, 0.125, -0.375, 0.625, 1.0, 2.0, 3.0, 943.25, 4.0, 600.5,
            11.5, 0x1A3F, 7)),
        ("wind_cov", m.MAVLink_wind_cov_message(
            20000, 3.5, -4.5, 0.25, 0.5, 0.75, 600.5, 1.25, 1.5)),
        ("actuator_output_status", m.MAVLink_actuator_output_status_message(30000, 5, ramp32)),
        ("aoa_ssa", m.MAVLink_aoa_ssa_message(40000, 2.25, -1.75)),
        ("all_zero", m.MAVLink_aoa_ssa_message(0, 0.0, 0.0)),
        ("hil_sensor", m.MAVLink_hil_sensor_message(
            50000, 0.5, -0.25, -9.75, 0.125, -0.375, 0.625, 0.25, 0.5, 0.75, 943.25, 4.5, 600.5,
            11.5, 0x1FFF, 0)),
        ("hil_gps", m.MAVLink_hil_gps_message(
            60000, 3, 468000001, -71234567, 600123, 90, 178, 1667, -1, 2, -3, 35999, 10, 0, 0)),
        ("hil_state_quaternion", m.MAVLink_hil_state_quaternion_message(
            70000, [0.5, -0.25, 0.125, 0.75], 1.5, -2.5, 3.5, 468000001, -71234567, 600123,
            -1000, 1667, -200, 1600, 1650, 11, -12, -1000)),
        ("mission_request", m.MAVLink_mission_request_message(1, 1, 7, 2)),
        ("mission_request_list", m.MAVLink_mission_request_list_message(1, 1, 1)),
        ("mission_count", m.MAVLink_mission_count_message(255, 190, 0, 2)),
        ("mission_clear_all", m.MAVLink_mission_clear_all_message(1, 1, 2)),
        ("mission_ack", m.MAVLink_mission_ack_message(255, 190, 13, 1)),
        ("mission_request_int", m.MAVLink_mission_request_int_message(1, 1, 7, 2)),
        ("autopilot_version", m.MAVLink_autopilot_version_message(
            0xE054, 0x010F00FF, 0, 0, 0, [1] * 8, [0] * 8, [2] * 8, 3, 4, 5, [6] * 18)),
        ("home_position", m.MAVLink_home_position_message(
            468000001, -71234567, 600123, 0.25, 0.5, 0.75, [1.0, 0.0, 0.0, 0.0], 1.5, 2.5, 3.5,
            80000)),
        ("message_interval", m.MAVLink_message_interval_message(31, -1)),
        ("file_transfer_protocol", m.MAVLink_file_transfer_protocol_message(
            0, 255, 190, [8, 0, 3, 129, 1, 4] + [0] * 6 + [7] + [0] * 237 + [9])),
    ]


def later(m):
    """The messages that only newer dialects define."""
    return [
        ("available_modes", m.MAVLink_available_modes_message(4, 2, 5, 0x05040000, 0, b"Return")),
    ]


def main():
    link = two.MAVLink(None, srcSystem=1, srcComponent=200)
    for sequence, (name, message) in enumerate(messages(two)):
        link.seq = sequence
        print(name, message.pack(link).hex())

    link.seq = 100
    for name, message in later(newer):
        print(name, message.pack(link).hex())

    # The answer of a companion that uses MAVLink 1.
    old = one.MAVLink(None, srcSystem=1, srcComponent=1)
    old.seq = 42
    controls = [0.25, -0.5, 0.75] + [0.0] * 13
    answer = one.MAVLink_hil_actuator_controls_message(123456789012345, controls, 128, 0)
    print("hil_actuator_controls_v1", answer.pack(old).hex())

    # A signed frame; the signature itself is not checked by the shim.
    signed = two.MAVLink(None, srcSystem=1, srcComponent=1)
    signed.signing.secret_key = bytes(range(32))
    signed.signing.link_id = 3
    signed.signing.timestamp = 1000
    signed.signing.sign_outgoing = True
    print("heartbeat_signed", two.MAVLink_heartbeat_message(1, 0, 129, 7, 4, 3).pack(signed).hex())

    # A message that the shim does not know.
    link.seq = 200
    text = two.MAVLink_statustext_message(6, b"unknown here")
    print("statustext", text.pack(link).hex())


main()
