//! Recognises files that are not readable logs by their first bytes, and advises the user what to do.

use super::format::MAVLINK_MARKERS;

/// First bytes of common files that cannot be read, each with a text that names the kind of file and the file to give instead.
const KNOWN: [(&[u8], &str); 11] = [
    (
        b"#ROSBAG V",
        "it is a ROS 1 bag, which is not read: make a ROS 2 bag of it by `rosbags-convert --src FILE --dst FOLDER --dst-storage mcap` (pip install rosbags) and give the .mcap in FOLDER",
    ),
    (
        b"SQLite format 3\0",
        "it is an SQLite database, such as a ROS 2 bag (.db3), which is not read: make an .mcap of it by `rosbags-convert --src FOLDER --dst NEW --dst-storage mcap` (pip install rosbags), or by `ros2 bag convert -i FOLDER -o to.yaml` with `output_bags: [{uri: NEW, storage_id: mcap, all: true}]` in to.yaml",
    ),
    (
        b"MATLAB 7.3 MAT-file",
        "it is a MATLAB file (7.3): greylag.logs.mat_to_csv of the Python package (pip install ./python) makes a CSV of it",
    ),
    (
        b"MATLAB 5.0 MAT-file",
        "it is a MATLAB file: greylag.logs.mat_to_csv of the Python package (pip install ./python) makes a CSV of it",
    ),
    (
        b"\x89HDF\r\n",
        "it is an HDF5 file: greylag.logs.mat_to_csv of the Python package (pip install ./python) makes a CSV of it",
    ),
    (
        b"H Product:Blackbox",
        "it is a blackbox log of Betaflight or iNav: blackbox_decode makes a CSV of it",
    ),
    (b"PK\x03\x04", "it is a ZIP archive: unpack it and give the log in it"),
    (b"{", "it is JSON: write its numbers to one CSV, a row for each time"),
    (b"[", "it is JSON: write its numbers to one CSV, a row for each time"),
    (
        b"<",
        "it is XML or HTML; the .log file of Paparazzi only declares messages, whose values stand in the .data file beside it: write them to one CSV, a row for each time",
    ),
    (b"%PDF", "it is a PDF document"),
];

/// Message about a ROS 2 bag if the program was built without the reader of bags.
#[cfg(not(feature = "ros"))]
pub(super) const BAG_WITHOUT_READER: &str = "it is a ROS 2 bag (MCAP), which this program was built without a reader for: build it with --features study, as `cargo greylag` and the installed program are";

/// If at least this number of bytes was read and all are zero, the file is not a log.
const EMPTY: usize = 256;

/// Returns a text about the kind of file that begins with `start`. `None` if the kind is unknown.
pub(super) fn kind(start: &[u8]) -> Option<&'static str> {
    if start.len() >= EMPTY && start.iter().all(|b| *b == 0) {
        return Some("its beginning is all zeros: the copy or the logger did not finish");
    }
    let text = start.trim_ascii_start();
    let known = KNOWN.iter().find(|(magic, _)| text.starts_with(magic)).map(|(_, what)| *what);
    known.or_else(|| frames_without_times(start).then_some(
        "it is a stream of MAVLink frames without their times, such as the mav.tlog.raw of MAVProxy: give the .tlog that was recorded beside it",
    ))
}

/// Message about a log of sdlog2, PX4's format before ULog. Its records look like those of a DataFlash log but have another
/// meaning.
pub(super) const SDLOG2: &str = "it is a log of PX4 from before ULog (sdlog2, .px4log), whose records have no times of their own: sdlog2_dump.py of that PX4 makes a CSV of it";

/// Number of successive MAVLink frames from which a stream is recognised.
const IN_A_ROW: usize = 3;

/// Whether `start` contains successive MAVLink frames. The rest of a cut frame may precede them.
fn frames_without_times(start: &[u8]) -> bool {
    let follow = |from: usize| {
        let mut at = from;
        for _ in 0..IN_A_ROW {
            let Some(len) = frame(&start[at.min(start.len())..]) else { return false };
            at += len;
        }
        true
    };
    (0..start.len().min(300)).any(follow)
}

/// Length of the MAVLink frame at the beginning of `bytes`, computed from its header. `None` if no frame begins there.
fn frame(bytes: &[u8]) -> Option<usize> {
    let [marker, payload, flags, ..] = bytes else { return None };
    let signature = if flags & 1 == 1 { 13 } else { 0 };
    MAVLINK_MARKERS.contains(marker).then(|| match marker {
        0xFE => 8 + usize::from(*payload),
        _ => 12 + usize::from(*payload) + signature,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_people_bring_is_named() {
        let ros = kind(b"#ROSBAG V2.0\n").unwrap();
        assert!(ros.contains("ROS 1 bag") && ros.contains("rosbags-convert"), "{ros}");
        assert!(kind(b"\n{\"time\": 0}\n").unwrap().contains("JSON"));
        assert_eq!(kind(b"\x89PNG\r\n"), None);
        assert!(kind(&[0; 4096]).unwrap().contains("zeros"));
    }

    #[test]
    fn a_telemetry_stream_without_times_is_known_even_if_it_begins_within_a_frame() {
        let frame = |payload: u8| {
            let mut frame = vec![0xFE, payload, 0, 1, 1, 0];
            frame.extend(vec![7; usize::from(payload) + 2]);
            frame
        };
        let stream = [vec![3; 20], frame(9), frame(28), frame(9)].concat();
        assert!(kind(&stream).unwrap().contains("without their times"));
        assert_eq!(kind(&[vec![3; 20], frame(9), vec![3; 40]].concat()), None);
    }
}
