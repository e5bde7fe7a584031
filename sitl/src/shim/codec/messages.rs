//! The messages of this link, each with its fields in wire order.
//!
//! Wire order is by falling size of the field's type, declaration order within a size, extension
//! fields last. Identifiers, CRC_EXTRA and orders were read off pymavlink 2.4.50
//! (`ardupilotmega`, MAVLink 2) and are held by `tests/shim_codec.rs`.

use super::field::{Field, Reader, Writer};

/// A MAVLink message that this link knows.
pub trait Message: Sized {
    /// Message identifier, 24 bits.
    const ID: u32;
    /// Seed that ties the checksum to the message's definition.
    const CRC_EXTRA: u8;
    /// Payload length in bytes with all extension fields.
    const LENGTH: usize;
    /// Appends every field in wire order.
    fn write(&self, writer: &mut Writer);
    /// Takes every field in wire order; missing bytes read as zero.
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

        /// The CRC_EXTRA of a message that this link knows; `None` for all others.
        pub fn crc_extra(id: u32) -> Option<u8> {
            match id {
                $( $id => Some($crc), )*
                _ => None,
            }
        }
    };
}

messages! {
    /// HEARTBEAT: who is there.
    Heartbeat = 0, crc_extra 50 {
        /// Autopilot-specific mode.
        custom_mode: u32,
        /// MAV_TYPE.
        kind: u8,
        /// MAV_AUTOPILOT.
        autopilot: u8,
        /// MAV_MODE_FLAG bits.
        base_mode: u8,
        /// MAV_STATE.
        system_status: u8,
        /// Always 3.
        mavlink_version: u8,
    }

    /// SYS_STATUS: sensors and battery.
    SysStatus = 1, crc_extra 124 {
        /// MAV_SYS_STATUS_SENSOR bits of what is fitted.
        onboard_control_sensors_present: u32,
        /// Bits of what is switched on.
        onboard_control_sensors_enabled: u32,
        /// Bits of what is healthy.
        onboard_control_sensors_health: u32,
        /// Processor load, per mille.
        load: u16,
        /// Battery voltage, mV.
        voltage_battery: u16,
        /// Battery current, cA; −1 is unknown.
        current_battery: i16,
        /// Communication drop rate, c%.
        drop_rate_comm: u16,
        /// Communication errors.
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
        /// Further bits of what is fitted (extension).
        onboard_control_sensors_present_extended: u32,
        /// Further bits of what is switched on (extension).
        onboard_control_sensors_enabled_extended: u32,
        /// Further bits of what is healthy (extension).
        onboard_control_sensors_health_extended: u32,
    }

    /// GPS_RAW_INT: what the receiver says.
    GpsRawInt = 24, crc_extra 24 {
        /// Simulated time, µs.
        time_usec: u64,
        /// Latitude, 1e-7 degrees.
        lat: i32,
        /// Longitude, 1e-7 degrees.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// Horizontal dilution of precision × 100.
        eph: u16,
        /// Vertical dilution of precision × 100.
        epv: u16,
        /// Ground speed, cm/s.
        vel: u16,
        /// Course over ground, cdeg, 0..35999.
        cog: u16,
        /// GPS_FIX_TYPE.
        fix_type: u8,
        /// Satellites.
        satellites_visible: u8,
        /// Altitude above the ellipsoid, mm (extension).
        alt_ellipsoid: i32,
        /// Position uncertainty, mm (extension).
        h_acc: u32,
        /// Altitude uncertainty, mm (extension).
        v_acc: u32,
        /// Speed uncertainty, mm/s (extension).
        vel_acc: u32,
        /// Heading uncertainty, 1e-5 degrees (extension).
        hdg_acc: u32,
        /// Yaw, cdeg; 0 is not available (extension).
        yaw: u16,
    }

    /// ATTITUDE_QUATERNION: attitude with body rates.
    AttitudeQuaternion = 31, crc_extra 246 {
        /// Simulated time, ms.
        time_boot_ms: u32,
        /// w of the rotation NED→FRD.
        q1: f32,
        /// x.
        q2: f32,
        /// y.
        q3: f32,
        /// z.
        q4: f32,
        /// p, rad/s.
        rollspeed: f32,
        /// q, rad/s.
        pitchspeed: f32,
        /// r, rad/s.
        yawspeed: f32,
        /// Rotation offset for display; all zero is none (extension).
        repr_offset_q: [f32; 4],
    }

    /// GLOBAL_POSITION_INT: fused position.
    GlobalPositionInt = 33, crc_extra 104 {
        /// Simulated time, ms.
        time_boot_ms: u32,
        /// Latitude, 1e-7 degrees.
        lat: i32,
        /// Longitude, 1e-7 degrees.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// Altitude above home, mm.
        relative_alt: i32,
        /// North, cm/s.
        vx: i16,
        /// East, cm/s.
        vy: i16,
        /// Down, cm/s.
        vz: i16,
        /// Heading, cdeg, 0..35999.
        hdg: u16,
    }

    /// VFR_HUD: what a pilot's display shows.
    VfrHud = 74, crc_extra 20 {
        /// True airspeed on this link, m/s.
        airspeed: f32,
        /// Ground speed, m/s.
        groundspeed: f32,
        /// Altitude above mean sea level, m.
        alt: f32,
        /// Climb rate, m/s.
        climb: f32,
        /// Heading, degrees, 0..359.
        heading: i16,
        /// Throttle, %.
        throttle: u16,
    }

    /// HIL_ACTUATOR_CONTROLS: the companion's answer to a state frame.
    HilActuatorControls = 93, crc_extra 47 {
        /// The time of the frame that is answered, µs.
        time_usec: u64,
        /// Bit 0: the sender is in lockstep; unused in the profile `sitl`.
        flags: u64,
        /// Aileron, elevator, throttle, then unused.
        controls: [f32; 16],
        /// MAV_MODE_FLAG bits; 128 is armed.
        mode: u8,
    }

    /// HIGHRES_IMU: inertial and air-pressure sensors.
    HighresImu = 105, crc_extra 93 {
        /// Simulated time of the frame, µs.
        time_usec: u64,
        /// Specific force along body x, m/s².
        xacc: f32,
        /// Specific force along body y, m/s².
        yacc: f32,
        /// Specific force along body z, m/s².
        zacc: f32,
        /// p, rad/s.
        xgyro: f32,
        /// q, rad/s.
        ygyro: f32,
        /// r, rad/s.
        zgyro: f32,
        /// Magnetic field along body x, gauss; unused here.
        xmag: f32,
        /// Magnetic field along body y, gauss; unused here.
        ymag: f32,
        /// Magnetic field along body z, gauss; unused here.
        zmag: f32,
        /// Static pressure, hPa.
        abs_pressure: f32,
        /// Dynamic pressure, hPa; unused here.
        diff_pressure: f32,
        /// Pressure altitude, m.
        pressure_alt: f32,
        /// Air temperature, °C.
        temperature: f32,
        /// HIGHRES_IMU_UPDATED bits of the fields that are valid.
        fields_updated: u16,
        /// Number of the sensor (extension).
        id: u8,
    }

    /// HIL_SENSOR: what a simulator's sensors show.
    HilSensor = 107, crc_extra 108 {
        /// Simulated time, µs.
        time_usec: u64,
        /// Specific force along body x, m/s².
        xacc: f32,
        /// Specific force along body y, m/s².
        yacc: f32,
        /// Specific force along body z, m/s².
        zacc: f32,
        /// p, rad/s.
        xgyro: f32,
        /// q, rad/s.
        ygyro: f32,
        /// r, rad/s.
        zgyro: f32,
        /// Magnetic field along body x, gauss.
        xmag: f32,
        /// Magnetic field along body y, gauss.
        ymag: f32,
        /// Magnetic field along body z, gauss.
        zmag: f32,
        /// Static pressure, hPa.
        abs_pressure: f32,
        /// Differential pressure, hPa.
        diff_pressure: f32,
        /// Pressure altitude, m.
        pressure_alt: f32,
        /// Air temperature, °C.
        temperature: f32,
        /// HIL_SENSOR_UPDATED_FLAGS: which fields are measured anew.
        fields_updated: u32,
        /// Number of the sensor (extension).
        id: u8,
    }

    /// HIL_GPS: what a simulator's receiver shows.
    HilGps = 113, crc_extra 124 {
        /// Simulated time, µs.
        time_usec: u64,
        /// Latitude, 1e-7 degrees.
        lat: i32,
        /// Longitude, 1e-7 degrees.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// Horizontal accuracy, cm.
        eph: u16,
        /// Vertical accuracy, cm.
        epv: u16,
        /// Ground speed, cm/s.
        vel: u16,
        /// North, cm/s.
        vn: i16,
        /// East, cm/s.
        ve: i16,
        /// Down, cm/s.
        vd: i16,
        /// Course over ground, cdeg, 0..35999.
        cog: u16,
        /// GPS_FIX_TYPE.
        fix_type: u8,
        /// Satellites.
        satellites_visible: u8,
        /// Number of the receiver (extension).
        id: u8,
        /// Yaw, cdeg; 0 is not available (extension).
        yaw: u16,
    }

    /// HIL_STATE_QUATERNION: a simulator's truth.
    HilStateQuaternion = 115, crc_extra 4 {
        /// Simulated time, µs.
        time_usec: u64,
        /// Rotation NED→FRD, w first.
        attitude_quaternion: [f32; 4],
        /// p, rad/s.
        rollspeed: f32,
        /// q, rad/s.
        pitchspeed: f32,
        /// r, rad/s.
        yawspeed: f32,
        /// Latitude, 1e-7 degrees.
        lat: i32,
        /// Longitude, 1e-7 degrees.
        lon: i32,
        /// Altitude above mean sea level, mm.
        alt: i32,
        /// North, cm/s.
        vx: i16,
        /// East, cm/s.
        vy: i16,
        /// Down, cm/s.
        vz: i16,
        /// Equivalent airspeed, cm/s.
        ind_airspeed: u16,
        /// True airspeed, cm/s.
        true_airspeed: u16,
        /// Specific force along body x, mG.
        xacc: i16,
        /// Specific force along body y, mG.
        yacc: i16,
        /// Specific force along body z, mG.
        zacc: i16,
    }

    /// MISSION_REQUEST: an item is asked for, in the old way.
    MissionRequest = 40, crc_extra 230 {
        /// Its number.
        seq: u16,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// MAV_MISSION_TYPE (extension).
        mission_type: u8,
    }

    /// MISSION_REQUEST_LIST: how many items are there?
    MissionRequestList = 43, crc_extra 132 {
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// MAV_MISSION_TYPE (extension).
        mission_type: u8,
    }

    /// MISSION_COUNT: so many items are there, or are offered.
    MissionCount = 44, crc_extra 221 {
        /// Their number.
        count: u16,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// MAV_MISSION_TYPE (extension).
        mission_type: u8,
    }

    /// MISSION_CLEAR_ALL: all items are to be forgotten.
    MissionClearAll = 45, crc_extra 232 {
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// MAV_MISSION_TYPE (extension).
        mission_type: u8,
    }

    /// MISSION_ACK: what came of a step of the mission protocol.
    MissionAck = 47, crc_extra 153 {
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// MAV_MISSION_RESULT.
        result: u8,
        /// MAV_MISSION_TYPE (extension).
        mission_type: u8,
    }

    /// MISSION_REQUEST_INT: an item is asked for.
    MissionRequestInt = 51, crc_extra 196 {
        /// Its number.
        seq: u16,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// MAV_MISSION_TYPE (extension).
        mission_type: u8,
    }

    /// FILE_TRANSFER_PROTOCOL: a step of MAVLink's FTP.
    FileTransferProtocol = 110, crc_extra 84 {
        /// Addressed network.
        target_network: u8,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// The first part of the payload: sequence number (2 bytes), session, opcode, size, the
        /// opcode that is answered, burst, padding, offset (4 bytes), data.
        payload: [[u8; 32]; 7],
        /// The rest.
        more: [u8; 27],
    }

    /// AUTOPILOT_VERSION: what the stack is and can.
    AutopilotVersion = 148, crc_extra 178 {
        /// MAV_PROTOCOL_CAPABILITY bits.
        capabilities: u64,
        /// Unique number of the hardware.
        uid: u64,
        /// FLIGHT_SW_VERSION: major, minor, patch, kind.
        flight_sw_version: u32,
        /// Version of the middleware.
        middleware_sw_version: u32,
        /// Version of the operating system.
        os_sw_version: u32,
        /// Version of the board.
        board_version: u32,
        /// USB vendor.
        vendor_id: u16,
        /// USB product.
        product_id: u16,
        /// Hash of the flight software.
        flight_custom_version: [u8; 8],
        /// Hash of the middleware.
        middleware_custom_version: [u8; 8],
        /// Hash of the operating system.
        os_custom_version: [u8; 8],
        /// Longer unique number (extension).
        uid2: [u8; 18],
    }

    /// HOME_POSITION: where home is.
    HomePosition = 242, crc_extra 104 {
        /// Latitude, 1e-7 degrees.
        latitude: i32,
        /// Longitude, 1e-7 degrees.
        longitude: i32,
        /// Altitude above mean sea level, mm.
        altitude: i32,
        /// Position in the local frame, m.
        local: [f32; 3],
        /// Orientation of the surface.
        q: [f32; 4],
        /// Way of approach, m.
        approach: [f32; 3],
        /// Time, µs (extension).
        time_usec: u64,
    }

    /// MESSAGE_INTERVAL: how often a message is sent.
    MessageInterval = 244, crc_extra 95 {
        /// µs; −1 is never, 0 a message that is not sent here.
        interval_us: i32,
        /// The message.
        message_id: u16,
    }

    /// PROTOCOL_VERSION: which MAVLink is spoken.
    ProtocolVersion = 300, crc_extra 217 {
        /// Version × 100.
        version: u16,
        /// Oldest, × 100.
        min_version: u16,
        /// Newest, × 100.
        max_version: u16,
        /// Hash of the specification.
        spec_version_hash: [u8; 8],
        /// Hash of the library.
        library_version_hash: [u8; 8],
    }

    /// AVAILABLE_MODES: a mode that can be flown.
    AvailableModes = 435, crc_extra 134 {
        /// Its number in the stack.
        custom_mode: u32,
        /// MAV_MODE_PROPERTY bits.
        properties: u32,
        /// How many modes there are.
        number_modes: u8,
        /// Which this is, from 1.
        mode_index: u8,
        /// MAV_STANDARD_MODE.
        standard_mode: u8,
        /// The first part of its name, filled up with zeros.
        mode_name: [u8; 32],
        /// The rest.
        more: [u8; 3],
    }

    /// PARAM_REQUEST_READ: a parameter is asked for.
    ParamRequestRead = 20, crc_extra 214 {
        /// Its index, −1 when it is asked for by name.
        param_index: i16,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// Its name, filled up with zeros.
        param_id: [u8; 16],
    }

    /// PARAM_REQUEST_LIST: all parameters are asked for.
    ParamRequestList = 21, crc_extra 159 {
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
    }

    /// PARAM_VALUE: a parameter.
    ParamValue = 22, crc_extra 220 {
        /// Its value, cast or bytewise.
        param_value: f32,
        /// How many there are.
        param_count: u16,
        /// Its index.
        param_index: u16,
        /// Its name, filled up with zeros.
        param_id: [u8; 16],
        /// MAV_PARAM_TYPE.
        param_type: u8,
    }

    /// PARAM_SET: a parameter is to be changed.
    ParamSet = 23, crc_extra 168 {
        /// The value, cast or bytewise.
        param_value: f32,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// Its name, filled up with zeros.
        param_id: [u8; 16],
        /// MAV_PARAM_TYPE.
        param_type: u8,
    }

    /// SERVO_OUTPUT_RAW: pulse widths of the outputs.
    ServoOutputRaw = 36, crc_extra 222 {
        /// Time, µs, modulo 2³².
        time_usec: u32,
        /// Outputs 1 to 8, µs.
        servo: [u16; 8],
        /// Output port.
        port: u8,
        /// Outputs 9 to 16, µs (extension).
        more: [u16; 8],
    }

    /// MANUAL_CONTROL: sticks of a joystick, in thousandths.
    ManualControl = 69, crc_extra 243 {
        /// Pitch, forward (nose down) is positive.
        x: i16,
        /// Roll, right is positive.
        y: i16,
        /// Throttle, 0..1000.
        z: i16,
        /// Yaw.
        r: i16,
        /// Buttons.
        buttons: u16,
        /// Addressed system.
        target: u8,
    }

    /// RC_CHANNELS_OVERRIDE: pulse widths in place of a radio's.
    RcChannelsOverride = 70, crc_extra 124 {
        /// Channels 1 to 8, µs; 0 gives a channel back, 65535 leaves it.
        channel: [u16; 8],
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
    }

    /// COMMAND_LONG: a command.
    CommandLong = 76, crc_extra 152 {
        /// Its parameters.
        param: [f32; 7],
        /// MAV_CMD.
        command: u16,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// How often it was sent before.
        confirmation: u8,
    }

    /// COMMAND_ACK: the answer to a command.
    CommandAck = 77, crc_extra 143 {
        /// MAV_CMD.
        command: u16,
        /// MAV_RESULT.
        result: u8,
        /// Progress, % (extension).
        progress: u8,
        /// More on the result (extension).
        result_param2: i32,
        /// Who sent the command (extension).
        target_system: u8,
        /// Who sent the command (extension).
        target_component: u8,
    }

    /// SET_ATTITUDE_TARGET: an attitude to be flown.
    SetAttitudeTarget = 82, crc_extra 49 {
        /// Sender's time, ms.
        time_boot_ms: u32,
        /// NED→FRD, w first.
        q: [f32; 4],
        /// Body rates p, q, r, rad/s.
        rates: [f32; 3],
        /// Thrust, 0..1.
        thrust: f32,
        /// Addressed system.
        target_system: u8,
        /// Addressed component.
        target_component: u8,
        /// What is to be ignored: 1, 2, 4 rates, 64 thrust, 128 attitude.
        type_mask: u8,
    }

    /// TIMESYNC: whose clock shows what.
    TimeSync = 111, crc_extra 34 {
        /// Time of the answering side, ns; 0 in a request.
        tc1: i64,
        /// Time of the asking side, ns.
        ts1: i64,
        /// Addressed system (extension).
        target_system: u8,
        /// Addressed component (extension).
        target_component: u8,
    }

    /// STATUSTEXT: a line of words.
    StatusText = 253, crc_extra 83 {
        /// MAV_SEVERITY.
        severity: u8,
        /// The first half of its words, filled up with zeros.
        text: [u8; 25],
        /// The second half.
        more: [u8; 25],
        /// Number of a line in chunks (extension).
        id: u16,
        /// Number of the chunk (extension).
        chunk_seq: u8,
    }

    /// WIND_COV: wind.
    WindCov = 231, crc_extra 105 {
        /// Simulated time, µs.
        time_usec: u64,
        /// Velocity of the air, north, m/s.
        wind_x: f32,
        /// Velocity of the air, east, m/s.
        wind_y: f32,
        /// Velocity of the air, down, m/s.
        wind_z: f32,
        /// Horizontal variability, m/s.
        var_horiz: f32,
        /// Vertical variability, m/s.
        var_vert: f32,
        /// Altitude of the measurement above mean sea level, m.
        wind_alt: f32,
        /// Horizontal accuracy, m/s.
        horiz_accuracy: f32,
        /// Vertical accuracy, m/s.
        vert_accuracy: f32,
    }

    /// ACTUATOR_OUTPUT_STATUS: where the actuators stand.
    ActuatorOutputStatus = 375, crc_extra 251 {
        /// Simulated time, µs.
        time_usec: u64,
        /// Number of valid outputs.
        active: u32,
        /// Positions and rates, normalised.
        actuator: [f32; 32],
    }

    /// AOA_SSA: angle of attack and of sideslip.
    AoaSsa = 11020, crc_extra 205 {
        /// Simulated time, µs.
        time_usec: u64,
        /// Angle of attack, degrees.
        aoa: f32,
        /// Angle of sideslip, degrees.
        ssa: f32,
    }
}
