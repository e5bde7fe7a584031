//! MAVLink 2 codec of the shim, independent of the companion's codec.
//!
//! The companion uses rust-mavlink. This codec shares no code with it, which makes an error in either codec visible as a
//! disagreement. The codec follows the serialisation guide <https://mavlink.io/en/guide/serialization.html> and is checked
//! against byte vectors from pymavlink (`tests/shim_vectors.py`).

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
