//! Definitions of the MAVLink messages that the shim uses, each with its fields in wire order.
//!
//! In wire order, larger field types come first, fields of equal size keep the order of their declaration, and extension fields
//! come last. Identifiers, CRC_EXTRA and orders are those of pymavlink 2.4.50 (`ardupilotmega`, MAVLink 2); `tests/shim/codec.rs`
//! checks them.

use super::field::{Field, Reader, Writer};

/// A MAVLink message that the shim can encode and decode.
pub trait Message: Sized {
    /// Message identifier, 24 bits.
    const ID: u32;
    /// Seed of the checksum that depends on the message's definition (CRC_EXTRA).
    const CRC_EXTRA: u8;
    /// Payload length in bytes including all extension fields.
    const LENGTH: usize;
    /// Appends every field in wire order.
    fn write(&self, writer: &mut Writer);
    /// Reads every field in wire order; missing bytes count as zero.
    fn read(reader: &mut Reader<'_>) -> Self;
}

macro_rules! messages {
    ($(
        $(#[$about:meta])*
        $name:ident = $id:literal, crc_extra $crc:literal {
            $( $(#[$field_about:meta])* $field:ident: $kind:ty, )*
        }
    )*) => {
        $(
            $(#[$about])*
            #[derive(Clone, Copy, Debug, Default, PartialEq)]
            pub struct $name {
                $( $(#[$field_about])* pub $field: $kind, )*
            }

            impl Message for $name {
                const ID: u32 = $id;
                const CRC_EXTRA: u8 = $crc;
                const LENGTH: usize = 0 $( + <$kind as Field>::SIZE )*;
                fn write(&self, writer: &mut Writer) {
                    $( self.$field.put(writer); )*
                }
                fn read(reader: &mut Reader<'_>) -> Self {
                    $( let $field = <$kind as Field>::take(reader); )*
                    $name { $( $field ),* }
                }
            }
        )*

        /// CRC_EXTRA of a message that the shim defines; `None` for any other message.
        pub fn crc_extra(id: u32) -> Option<u8> {
            match id {
                $( $id => Some($crc), )*
                _ => None,
            }
        }
    };
}

messages! {
    /// HEARTBEAT: identity, mode and state of a component.
    Heartbeat = 0, crc_extra 50 {
        /// Flight mode, numbered by the flight stack (PX4 and ArduPilot differ).
        custom_mode: u32,
        /// MAV_TYPE of the vehicle or component; 1 is a fixed wing.
        kind: u8,
        /// MAV_AUTOPILOT of the sender; 8 is none.
        autopilot: u8,
        /// MAV_MODE_FLAG bits; 128 is armed.
        base_mode: u8,
        /// MAV_STATE of the sender; 4 is active.
        system_status: u8,
        /// Version of the MAVLink dialect: always 3.
        mavlink_version: u8,
    }

    /// SYS_STATUS, sent by the simulator at 1 Hz: sensor health and battery.
    SysStatus = 1, crc_extra 124 {
        /// MAV_SYS_STATUS_SENSOR bits of the sensors that are fitted.
        onboard_control_sensors_present: u32,
        /// MAV_SYS_STATUS_SENSOR bits of the sensors that are enabled.
        onboard_control_sensors_enabled: u32,
        /// MAV_SYS_STATUS_SENSOR bits of the sensors that are healthy.
        onboard_control_sensors_health: u32,
        /// Load of the main loop, per mille.
        load: u16,
        /// Voltage of the battery, mV.
        voltage_battery: u16,
        /// Battery current, cA; −1 is unknown.
        current_battery: i16,
        /// Communication drop rate, c%.
        drop_rate_comm: u16,
        /// Number of dropped packets.
        errors_comm: u16,
        /// Autopilot-specific errors, first count.
        errors_count1: u16,
        /// Autopilot-specific errors, second count.
        errors_count2: u16,
        /// Autopilot-specific errors, third count.
        errors_count3: u16,
        /// Autopilot-specific errors, fourth count.
        errors_count4: u16,
        /// Battery remaining, %; −1 is unknown.
        battery_remaining: i8,
        /// Further bits of the sensors that are fitted (extension).
        onboard_control_sensors_present_extended: u32,
        /// Further bits of the sensors that are enabled (extension).
        onboard_control_sensors_enabled_extended: u32,
        /// Further bits of the sensors that are healthy (extension).
        onboard_control_sensors_health_extended: u32,
    }

    /// GPS_RAW_INT, sent by the simulator at 5 Hz: position and velocity of the GPS receiver.
    GpsRawInt = 24, crc_extra 24 {
        /// Simulated time since the start of the run, µs.
        time_usec: u64,
        /// Geodetic latitude, 1e-7 degrees, north positive.
        lat: i32,
        /// Longitude, 1e-7 degrees, east positive.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// Horizontal dilution of precision × 100.
        eph: u16,
        /// Vertical dilution of precision × 100.
        epv: u16,
        /// Horizontal speed over the ground, cm/s.
        vel: u16,
        /// Course over ground, cdeg, 0..35999.
        cog: u16,
        /// GPS_FIX_TYPE of the receiver; 3 is a 3D fix.
        fix_type: u8,
        /// Number of visible satellites.
        satellites_visible: u8,
        /// Altitude above the ellipsoid, mm (extension).
        alt_ellipsoid: i32,
        /// Standard deviation of the horizontal position, mm (extension).
        h_acc: u32,
        /// Standard deviation of the altitude, mm (extension).
        v_acc: u32,
        /// Standard deviation of the speed, mm/s (extension).
        vel_acc: u32,
        /// Standard deviation of the heading, 1e-5 degrees (extension).
        hdg_acc: u32,
        /// Yaw, cdeg; 0 is not available (extension).
        yaw: u16,
    }

    /// ATTITUDE_QUATERNION, last of the five messages of a state frame: attitude and body rates.
    AttitudeQuaternion = 31, crc_extra 246 {
        /// Simulated time since the start of the run, ms.
        time_boot_ms: u32,
        /// Scalar part w of the unit quaternion of the rotation NED→FRD.
        q1: f32,
        /// Vector part x of the quaternion.
        q2: f32,
        /// Vector part y of the quaternion.
        q3: f32,
        /// Vector part z of the quaternion.
        q4: f32,
        /// Roll rate p about body x (forward), rad/s.
        rollspeed: f32,
        /// Pitch rate q about body y (right), rad/s.
        pitchspeed: f32,
        /// Yaw rate r about body z (down), rad/s.
        yawspeed: f32,
        /// Rotation offset for display; all zero is none (extension).
        repr_offset_q: [f32; 4],
    }

    /// GLOBAL_POSITION_INT, sent by the simulator at 10 Hz: position and velocity estimate.
    GlobalPositionInt = 33, crc_extra 104 {
        /// Simulated time since the start of the run, ms.
        time_boot_ms: u32,
        /// Geodetic latitude, 1e-7 degrees, north positive.
        lat: i32,
        /// Longitude, 1e-7 degrees, east positive.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// Altitude above home, mm.
        relative_alt: i32,
        /// North component of the ground velocity, cm/s.
        vx: i16,
        /// East component of the ground velocity, cm/s.
        vy: i16,
        /// Down component of the ground velocity, cm/s.
        vz: i16,
        /// Yaw angle, cdeg, 0..35999.
        hdg: u16,
    }

    /// VFR_HUD: airspeed, ground speed, altitude, heading and throttle.
    VfrHud = 74, crc_extra 20 {
        /// Airspeed, m/s: true on the link of the profile `sitl`, equivalent from a flight
        /// controller.
        airspeed: f32,
        /// Horizontal speed over the ground, m/s.
        groundspeed: f32,
        /// Altitude above mean sea level, m.
        alt: f32,
        /// Climb rate, m/s, up positive.
        climb: f32,
        /// Yaw angle, degrees, 0..359.
        heading: i16,
        /// Position of the throttle, %.
        throttle: u16,
    }

    /// HIL_ACTUATOR_CONTROLS: actuator commands of the companion or of PX4 in answer to a state frame.
    HilActuatorControls = 93, crc_extra 47 {
        /// Time stamp of the answered frame, µs.
        time_usec: u64,
        /// Bit 0: the sender is in lockstep; unused in the profile `sitl`.
        flags: u64,
        /// Aileron, elevator, throttle, rudder, then unused elements; from PX4, the outputs 1 to 16.
        controls: [f32; 16],
        /// MAV_MODE_FLAG bits; 128 is armed.
        mode: u8,
    }

    /// HIGHRES_IMU, first of the five messages of a state frame: inertial and air-pressure sensors.
    HighresImu = 105, crc_extra 93 {
        /// Simulated time of the state frame, µs since the start of the run.
        time_usec: u64,
        /// Specific force along body x, m/s².
        xacc: f32,
        /// Specific force along body y, m/s².
        yacc: f32,
        /// Specific force along body z, m/s².
        zacc: f32,
        /// Roll rate p about body x (forward), rad/s.
        xgyro: f32,
        /// Pitch rate q about body y (right), rad/s.
        ygyro: f32,
        /// Yaw rate r about body z (down), rad/s.
        zgyro: f32,
        /// Magnetic field along body x, gauss; unused here.
        xmag: f32,
        /// Magnetic field along body y, gauss; unused here.
        ymag: f32,
        /// Magnetic field along body z, gauss; unused here.
        zmag: f32,
        /// Absolute static pressure, hPa.
        abs_pressure: f32,
        /// Differential (pitot minus static) pressure, hPa; not sent here.
        diff_pressure: f32,
        /// Altitude above mean sea level, m; the simulator sends the geometric altitude.
        pressure_alt: f32,
        /// Static air temperature, °C.
        temperature: f32,
        /// HIGHRES_IMU_UPDATED bits of the fields that are valid.
        fields_updated: u16,
        /// Instance number of the IMU, from 0 (extension).
        id: u8,
    }

    /// HIL_SENSOR, sent by the simulator to PX4: inertial, magnetic and air-pressure sensors.
    HilSensor = 107, crc_extra 108 {
        /// Simulated time since the start of the run, µs.
        time_usec: u64,
        /// Specific force along body x, m/s².
        xacc: f32,
        /// Specific force along body y, m/s².
        yacc: f32,
        /// Specific force along body z, m/s².
        zacc: f32,
        /// Roll rate p about body x (forward), rad/s.
        xgyro: f32,
        /// Pitch rate q about body y (right), rad/s.
        ygyro: f32,
        /// Yaw rate r about body z (down), rad/s.
        zgyro: f32,
        /// Magnetic field along body x, gauss.
        xmag: f32,
        /// Magnetic field along body y, gauss.
        ymag: f32,
        /// Magnetic field along body z, gauss.
        zmag: f32,
        /// Absolute static pressure, hPa.
        abs_pressure: f32,
        /// Differential (pitot minus static) pressure, hPa.
        diff_pressure: f32,
        /// Pressure altitude in the standard atmosphere, m.
        pressure_alt: f32,
        /// Static air temperature, °C.
        temperature: f32,
        /// HIL_SENSOR_UPDATED_FLAGS: bits of the fields that were measured for this message.
        fields_updated: u32,
        /// Instance number of the sensor, from 0 (extension).
        id: u8,
    }

    /// HIL_GPS, sent by the simulator to PX4: position and velocity of the GPS receiver.
    HilGps = 113, crc_extra 124 {
        /// Simulated time since the start of the run, µs.
        time_usec: u64,
        /// Geodetic latitude, 1e-7 degrees, north positive.
        lat: i32,
        /// Longitude, 1e-7 degrees, east positive.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// Horizontal accuracy, cm, as PX4 reads it.
        eph: u16,
        /// Vertical accuracy, cm, as PX4 reads it.
        epv: u16,
        /// Horizontal speed over the ground, cm/s.
        vel: u16,
        /// North component of the ground velocity, cm/s.
        vn: i16,
        /// East component of the ground velocity, cm/s.
        ve: i16,
        /// Down component of the ground velocity, cm/s.
        vd: i16,
        /// Course over ground, cdeg, 0..35999.
        cog: u16,
        /// GPS_FIX_TYPE of the receiver; 3 is a 3D fix.
        fix_type: u8,
        /// Number of visible satellites.
        satellites_visible: u8,
        /// Instance number of the receiver, from 0 (extension).
        id: u8,
        /// Yaw, cdeg; 0 is not available (extension).
        yaw: u16,
    }

    /// HIL_STATE_QUATERNION, sent by the simulator to PX4 on request: true state of the aircraft.
    HilStateQuaternion = 115, crc_extra 4 {
        /// Simulated time since the start of the run, µs.
        time_usec: u64,
        /// Unit quaternion of the rotation NED→FRD, w first.
        attitude_quaternion: [f32; 4],
        /// Roll rate p about body x (forward), rad/s.
        rollspeed: f32,
        /// Pitch rate q about body y (right), rad/s.
        pitchspeed: f32,
        /// Yaw rate r about body z (down), rad/s.
        yawspeed: f32,
        /// Geodetic latitude, 1e-7 degrees, north positive.
        lat: i32,
        /// Longitude, 1e-7 degrees, east positive.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// North component of the ground velocity, cm/s.
        vx: i16,
        /// East component of the ground velocity, cm/s.
        vy: i16,
        /// Down component of the ground velocity, cm/s.
        vz: i16,
        /// Equivalent airspeed (wire name `ind_airspeed`), cm/s.
        ind_airspeed: u16,
        /// True airspeed relative to the air, cm/s.
        true_airspeed: u16,
        /// Specific force along body x, mG.
        xacc: i16,
        /// Specific force along body y, mG.
        yacc: i16,
        /// Specific force along body z, mG.
        zacc: i16,
    }

    /// MISSION_REQUEST: requests one mission item (deprecated in favour of MISSION_REQUEST_INT).
    MissionRequest = 40, crc_extra 230 {
        /// Index of the requested item, from 0.
        seq: u16,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// MAV_MISSION_TYPE: mission, geofence or rally points (extension).
        mission_type: u8,
    }

    /// MISSION_REQUEST_LIST: requests the number of mission items.
    MissionRequestList = 43, crc_extra 132 {
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// MAV_MISSION_TYPE: mission, geofence or rally points (extension).
        mission_type: u8,
    }

    /// MISSION_COUNT: number of mission items stored, or about to be uploaded.
    MissionCount = 44, crc_extra 221 {
        /// Number of mission items.
        count: u16,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// MAV_MISSION_TYPE: mission, geofence or rally points (extension).
        mission_type: u8,
    }

    /// MISSION_CLEAR_ALL: requests the deletion of all mission items.
    MissionClearAll = 45, crc_extra 232 {
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// MAV_MISSION_TYPE: mission, geofence or rally points (extension).
        mission_type: u8,
    }

    /// MISSION_ACK: result of a mission transfer.
    MissionAck = 47, crc_extra 153 {
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// MAV_MISSION_RESULT of the transfer.
        result: u8,
        /// MAV_MISSION_TYPE: mission, geofence or rally points (extension).
        mission_type: u8,
    }

    /// MISSION_REQUEST_INT: requests one mission item.
    MissionRequestInt = 51, crc_extra 196 {
        /// Index of the requested item, from 0.
        seq: u16,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// MAV_MISSION_TYPE: mission, geofence or rally points (extension).
        mission_type: u8,
    }

    /// FILE_TRANSFER_PROTOCOL: one request or response of MAVLink FTP.
    FileTransferProtocol = 110, crc_extra 84 {
        /// Network ID of the addressee; 0 addresses every network.
        target_network: u8,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// Bytes 0 to 223 of the payload: sequence number (2 bytes), session, opcode, size, opcode
        /// of the answered request, burst, padding, offset (4 bytes), data.
        payload: [[u8; 32]; 7],
        /// Bytes 224 to 250 of the payload.
        more: [u8; 27],
    }

    /// AUTOPILOT_VERSION: versions and capabilities of the flight stack.
    AutopilotVersion = 148, crc_extra 178 {
        /// MAV_PROTOCOL_CAPABILITY bits of the flight stack.
        capabilities: u64,
        /// Unique identifier of the hardware.
        uid: u64,
        /// FLIGHT_SW_VERSION: major, minor, patch, kind.
        flight_sw_version: u32,
        /// Version number of the middleware.
        middleware_sw_version: u32,
        /// Version number of the operating system.
        os_sw_version: u32,
        /// Version number of the board.
        board_version: u32,
        /// USB vendor ID of the board.
        vendor_id: u16,
        /// USB product ID of the board.
        product_id: u16,
        /// First 8 bytes of the flight software's git hash.
        flight_custom_version: [u8; 8],
        /// First 8 bytes of the middleware's git hash.
        middleware_custom_version: [u8; 8],
        /// First 8 bytes of the operating system's git hash.
        os_custom_version: [u8; 8],
        /// Unique identifier of the hardware in 18 bytes (extension).
        uid2: [u8; 18],
    }

    /// HOME_POSITION: position to which the vehicle returns.
    HomePosition = 242, crc_extra 104 {
        /// Geodetic latitude, 1e-7 degrees, north positive.
        latitude: i32,
        /// Longitude, 1e-7 degrees, east positive.
        longitude: i32,
        /// Altitude above mean sea level, mm.
        altitude: i32,
        /// Position in the local NED frame, m.
        local: [f32; 3],
        /// Orientation of the ground surface at home, quaternion, w first.
        q: [f32; 4],
        /// End of the approach vector in the local NED frame, m.
        approach: [f32; 3],
        /// Time stamp, µs (extension).
        time_usec: u64,
    }

    /// MESSAGE_INTERVAL: period of a message's stream.
    MessageInterval = 244, crc_extra 95 {
        /// Period, µs; −1 is disabled, 0 is a message that is not available.
        interval_us: i32,
        /// Identifier of the message.
        message_id: u16,
    }

    /// PROTOCOL_VERSION: MAVLink versions that the sender supports.
    ProtocolVersion = 300, crc_extra 217 {
        /// MAVLink version in use × 100.
        version: u16,
        /// Oldest supported MAVLink version × 100.
        min_version: u16,
        /// Newest supported MAVLink version × 100.
        max_version: u16,
        /// First 8 bytes of the specification's git hash.
        spec_version_hash: [u8; 8],
        /// First 8 bytes of the library's git hash.
        library_version_hash: [u8; 8],
    }

    /// AVAILABLE_MODES: one flight mode of the stack.
    AvailableModes = 435, crc_extra 134 {
        /// Value of `custom_mode` in HEARTBEAT that denotes this mode.
        custom_mode: u32,
        /// MAV_MODE_PROPERTY bits of the mode.
        properties: u32,
        /// Number of available modes.
        number_modes: u8,
        /// Index of this mode, from 1.
        mode_index: u8,
        /// MAV_STANDARD_MODE that this mode implements; 0 is none.
        standard_mode: u8,
        /// Bytes 0 to 31 of the mode's name, padded with zeros.
        mode_name: [u8; 32],
        /// Bytes 32 to 34 of the mode's name.
        more: [u8; 3],
    }

    /// PARAM_REQUEST_READ: requests one parameter.
    ParamRequestRead = 20, crc_extra 214 {
        /// Index of the parameter; −1 selects it by name.
        param_index: i16,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// Name of the parameter, padded with zeros.
        param_id: [u8; 16],
    }

    /// PARAM_REQUEST_LIST: requests all parameters.
    ParamRequestList = 21, crc_extra 159 {
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
    }

    /// PARAM_VALUE: value of one parameter.
    ParamValue = 22, crc_extra 220 {
        /// Value: cast to a float (ArduPilot) or its bytes (PX4).
        param_value: f32,
        /// Total number of parameters.
        param_count: u16,
        /// Index of this parameter, from 0.
        param_index: u16,
        /// Name of the parameter, padded with zeros.
        param_id: [u8; 16],
        /// MAV_PARAM_TYPE of the value.
        param_type: u8,
    }

    /// PARAM_SET: sets one parameter.
    ParamSet = 23, crc_extra 168 {
        /// New value: cast to a float (ArduPilot) or its bytes (PX4).
        param_value: f32,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// Name of the parameter, padded with zeros.
        param_id: [u8; 16],
        /// MAV_PARAM_TYPE of the value.
        param_type: u8,
    }

    /// SERVO_OUTPUT_RAW: pulse widths of the flight controller's outputs.
    ServoOutputRaw = 36, crc_extra 222 {
        /// Time stamp, µs, modulo 2³².
        time_usec: u32,
        /// Pulse widths of outputs 1 to 8, µs.
        servo: [u16; 8],
        /// Number of the output port, from 0.
        port: u8,
        /// Pulse widths of outputs 9 to 16, µs (extension).
        more: [u16; 8],
    }

    /// MANUAL_CONTROL: stick positions, −1000..1000.
    ManualControl = 69, crc_extra 243 {
        /// Pitch stick; forward (nose down) is positive.
        x: i16,
        /// Roll stick; right is positive.
        y: i16,
        /// Throttle stick, 0..1000.
        z: i16,
        /// Yaw stick; right is positive.
        r: i16,
        /// Bits of the pressed buttons.
        buttons: u16,
        /// System ID of the addressee.
        target: u8,
    }

    /// RC_CHANNELS_OVERRIDE: pulse widths that replace those of the RC receiver.
    RcChannelsOverride = 70, crc_extra 124 {
        /// Pulse widths of channels 1 to 8, µs; 0 returns a channel to the receiver, 65535 leaves
        /// it unchanged.
        channel: [u16; 8],
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
    }

    /// COMMAND_LONG: one command with seven parameters.
    CommandLong = 76, crc_extra 152 {
        /// Parameters 1 to 7; their meaning depends on the command.
        param: [f32; 7],
        /// MAV_CMD number of the command.
        command: u16,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// Number of earlier transmissions of this command.
        confirmation: u8,
    }

    /// COMMAND_ACK: result of a command.
    CommandAck = 77, crc_extra 143 {
        /// MAV_CMD number of the command.
        command: u16,
        /// MAV_RESULT of the command.
        result: u8,
        /// Progress of the command, % (extension).
        progress: u8,
        /// Additional result, specific to the command (extension).
        result_param2: i32,
        /// System ID of the command's sender (extension).
        target_system: u8,
        /// Component ID of the command's sender (extension).
        target_component: u8,
    }

    /// SET_ATTITUDE_TARGET, sent by the companion: attitude, body rate and thrust setpoint.
    SetAttitudeTarget = 82, crc_extra 49 {
        /// Sender's time since boot, ms.
        time_boot_ms: u32,
        /// Commanded attitude, rotation NED→FRD as a unit quaternion, w first.
        q: [f32; 4],
        /// Commanded body rates p, q, r, rad/s.
        rates: [f32; 3],
        /// Commanded collective thrust, 0..1.
        thrust: f32,
        /// System ID of the addressee; 0 addresses every system.
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component.
        target_component: u8,
        /// ATTITUDE_TARGET_TYPEMASK bits of fields to ignore: 1, 2, 4 rates, 64 thrust, 128
        /// attitude.
        type_mask: u8,
    }

    /// TIMESYNC: request or answer of the clock-offset measurement.
    TimeSync = 111, crc_extra 34 {
        /// Time of the answering side, ns; 0 in a request.
        tc1: i64,
        /// Time of the asking side, ns.
        ts1: i64,
        /// System ID of the addressee; 0 addresses every system (extension).
        target_system: u8,
        /// Component ID of the addressee; 0 addresses every component (extension).
        target_component: u8,
    }

    /// STATUSTEXT: one line of text for the operator.
    StatusText = 253, crc_extra 83 {
        /// MAV_SEVERITY of the line; 0 is the most severe.
        severity: u8,
        /// Bytes 0 to 24 of the text, padded with zeros.
        text: [u8; 25],
        /// Bytes 25 to 49 of the text.
        more: [u8; 25],
        /// Identifier shared by the chunks of a long text (extension).
        id: u16,
        /// Index of this chunk, from 0 (extension).
        chunk_seq: u8,
    }

    /// WIND_COV, sent by the simulator at 1 Hz: wind and its variability.
    WindCov = 231, crc_extra 105 {
        /// Simulated time since the start of the run, µs.
        time_usec: u64,
        /// Velocity of the air, north, m/s.
        wind_x: f32,
        /// Velocity of the air, east, m/s.
        wind_y: f32,
        /// Velocity of the air, down, m/s.
        wind_z: f32,
        /// Standard deviation of the horizontal wind, m/s.
        var_horiz: f32,
        /// Standard deviation of the vertical wind, m/s.
        var_vert: f32,
        /// Altitude of the measurement above mean sea level, m.
        wind_alt: f32,
        /// Accuracy of the horizontal wind, m/s.
        horiz_accuracy: f32,
        /// Accuracy of the vertical wind, m/s.
        vert_accuracy: f32,
    }

    /// ACTUATOR_OUTPUT_STATUS, fourth message of a state frame: actuator positions and travel.
    ActuatorOutputStatus = 375, crc_extra 251 {
        /// Simulated time since the start of the run, µs.
        time_usec: u64,
        /// Number of valid elements of `actuator`.
        active: u32,
        /// Aileron, elevator, throttle positions; aileron and elevator rates, 1/s; then, for aircraft
        /// other than the X8, the travels in rad. Positions and rates are normalised by the largest
        /// deflection; PROTOCOL.md lists the elements.
        actuator: [f32; 32],
    }

    /// AOA_SSA, third message of a state frame: flow angles.
    AoaSsa = 11020, crc_extra 205 {
        /// Simulated time since the start of the run, µs.
        time_usec: u64,
        /// Angle of attack α, degrees.
        aoa: f32,
        /// Sideslip angle β, degrees.
        ssa: f32,
    }
}
