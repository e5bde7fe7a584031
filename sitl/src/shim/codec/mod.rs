//! MAVLink 2 for the messages of this link, written apart from the companion's codec.
//!
//! The companion speaks through rust-mavlink; this codec shares no code with it, so that a slip in
//! either shows as a disagreement between the two. It follows the serialisation guide of
//! <https://mavlink.io/en/guide/serialization.html> and is checked against byte vectors made by
//! pymavlink (`tests/shim_vectors.py`).

mod field;
mod frame;
mod messages;
mod parser;

pub use field::{Field, Reader, Writer};
pub use frame::{Encoder, Frame, Version, checksum};
pub use messages::{
    ActuatorOutputStatus, AoaSsa, AttitudeQuaternion, AutopilotVersion, AvailableModes, CommandAck,
    CommandLong, FileTransferProtocol, GlobalPositionInt, GpsRawInt, Heartbeat, HighresImu,
    HilActuatorControls, HilGps, HilSensor, HilStateQuaternion, HomePosition, ManualControl,
    Message, MessageInterval, MissionAck, MissionClearAll, MissionCount, MissionRequest,
    MissionRequestInt, MissionRequestList, ParamRequestList, ParamRequestRead, ParamSet,
    ParamValue, ProtocolVersion, RcChannelsOverride, ServoOutputRaw, SetAttitudeTarget, StatusText,
    SysStatus, TimeSync, VfrHud, WindCov, crc_extra,
};
pub use parser::Parser;
