//! Frames cut out of good, bad and hostile bytes.

use crate::link_support::{frame, raw_frame};
use greylag::link::framing::{self, FrameCounts, Frames, Source, StreamCutter, Version};
use mavlink::dialects::ardupilotmega::*;
use mavlink::{MavlinkVersion, Message};

fn attitude() -> MavMessage {
    MavMessage::ATTITUDE(ATTITUDE_DATA {
        time_boot_ms: 1000,
        roll: 0.5,
        yawspeed: 0.25,
        ..Default::default()
    })
}

fn ids(bytes: &[u8]) -> (Vec<u32>, FrameCounts) {
    let mut counts = FrameCounts::default();
    let ids = Frames::new(bytes, &mut counts).map(|f| f.id).collect();
    (ids, counts)
}

#[test]
fn frames_of_rust_mavlink_are_read_in_both_versions() {
    for (version, expected) in
        [(MavlinkVersion::V1, Version::V1), (MavlinkVersion::V2, Version::V2)]
    {
        let bytes = frame(version, &attitude());
        let mut counts = FrameCounts::default();
        let frames: Vec<_> = Frames::new(&bytes, &mut counts).collect();
        assert_eq!(frames.len(), 1);
        assert_eq!(frames[0].version, expected);
        assert_eq!(frames[0].source, Source { system: 255, component: 190 });
        assert_eq!((frames[0].id, frames[0].sequence), (30, 42));
        assert_eq!(frames[0].bytes, &bytes[..]);
        assert_eq!(counts, FrameCounts { good: 1, ..Default::default() });
    }
}

#[test]
fn frames_are_written_to_the_byte_as_rust_mavlink_writes_them() {
    // The second message ends in zeros, the third is all zeros: MAVLink 2 cuts them, but for one.
    let messages = [
        attitude(),
        MavMessage::STATUSTEXT(STATUSTEXT_DATA { text: "short".into(), ..Default::default() }),
        MavMessage::PARAM_REQUEST_LIST(Default::default()),
    ];
    for message in messages {
        for (codec, ours) in [(MavlinkVersion::V1, Version::V1), (MavlinkVersion::V2, Version::V2)]
        {
            let mut payload = [0; 255];
            let len = message.ser(codec, &mut payload);
            let from = Source { system: 255, component: 190 };
            let written =
                framing::write(ours, 42, from, message.message_id(), &payload[..len]).unwrap();
            assert_eq!(written, frame(codec, &message));
        }
    }
}

#[test]
fn mavlink_1_has_no_room_for_numbers_above_255() {
    let from = Source { system: 1, component: 1 };
    assert!(framing::write(Version::V1, 0, from, 300, &[0; 22]).is_none());
    assert!(framing::write(Version::V2, 0, from, 300, &[0; 22]).is_some());
}

#[test]
fn every_truncation_and_every_bit_flip_is_refused() {
    let bytes = frame(MavlinkVersion::V2, &attitude());
    for len in 0..bytes.len() {
        assert_eq!(ids(&bytes[..len]).1.good, 0, "cut to {len}");
    }
    for bit in 0..bytes.len() * 8 {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        // The compatibility flags (byte 3) are under the CRC like everything else.
        assert_eq!(ids(&flipped).1.good, 0, "bit {bit} flipped");
    }
}

#[test]
fn good_frames_around_garbage_are_found() {
    let good = frame(MavlinkVersion::V2, &attitude());
    let mut bad = good.clone();
    *bad.last_mut().unwrap() ^= 0xFF;
    let truncated = &good[..good.len() - 3];
    let mut bytes = vec![0x00, 0xFD, 0x03, 0xFE];
    bytes.extend(&good);
    bytes.extend(&bad);
    bytes.extend(&good);
    bytes.extend(truncated);
    let (ids, counts) = ids(&bytes);
    assert_eq!(ids, [30, 30]);
    assert!(counts.bad_crc >= 1 && counts.truncated >= 1, "{counts:?}");
}

#[test]
fn unknown_incompatibility_flags_are_refused_and_signed_frames_are_frames() {
    let mut flagged = frame(MavlinkVersion::V2, &attitude());
    flagged[2] = 0x02;
    let end = flagged.len() - 2;
    let crc = mavlink::calculate_crc(&flagged[1..end], 39);
    flagged[end..].copy_from_slice(&crc.to_le_bytes());
    let (found, counts) = ids(&flagged);
    assert!(found.is_empty());
    assert_eq!(counts.refused, 1);

    // 39 is the CRC extra of ATTITUDE. A signature is 13 bytes behind the checksum.
    let mut signed = frame(MavlinkVersion::V2, &attitude());
    signed[2] = 0x01;
    let crc = mavlink::calculate_crc(&signed[1..end], 39);
    signed[end..].copy_from_slice(&crc.to_le_bytes());
    signed.extend([0xFD; 13]);
    signed.extend(frame(MavlinkVersion::V1, &attitude()));
    let (found, counts) = ids(&signed);
    assert_eq!(found, [30, 30]);
    assert_eq!(counts, FrameCounts { good: 2, ..Default::default() });
}

#[test]
fn an_unknown_message_is_counted_and_skipped() {
    // Number 60000 is in no dialect; its payload holds a start marker.
    let mut bytes = raw_frame(60000, &[0xFD, 1, 2, 3]);
    bytes.extend(frame(MavlinkVersion::V2, &attitude()));
    let (found, counts) = ids(&bytes);
    assert_eq!(found, [30]);
    assert_eq!(counts, FrameCounts { good: 1, unknown: 1, ..Default::default() });
}

#[test]
fn a_stream_is_cut_alike_in_chunks_of_any_size() {
    let mut stream = vec![0xFE, 0xFD, 0x55];
    for _ in 0..5 {
        stream.extend(frame(MavlinkVersion::V2, &attitude()));
        stream.extend(frame(MavlinkVersion::V1, &attitude()));
        stream.push(0xFD);
    }
    for size in [1, 2, 7, 64, 1024] {
        let (mut cutter, mut found) = (StreamCutter::default(), 0);
        stream.chunks(size).for_each(|chunk| cutter.push(chunk, |_| found += 1));
        cutter.flush(|_| found += 1);
        assert_eq!(found, 10, "chunks of {size}");
        assert!(!cutter.is_waiting());
    }
}

#[test]
fn noise_costs_a_bounded_amount_of_work() {
    // 9000 start markers would be 9000 CRCs over 255 bytes if each were tried.
    let noise = vec![0xFE; 9000];
    let (found, counts) = ids(&noise);
    assert!(found.is_empty());
    assert!(counts.bad() <= 64, "{counts:?}");
    assert!(counts.dropped_bytes > 8000);
    let mut cutter = StreamCutter::default();
    noise.chunks(1024).for_each(|chunk| cutter.push(chunk, |_| panic!("a frame in noise")));
    cutter.flush(|_| panic!("a frame in noise"));
    assert!(!cutter.is_waiting());
}
