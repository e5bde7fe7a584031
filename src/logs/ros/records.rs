//! Decodes the records of an MCAP file (a bag of ROS 2) that declare topics, and lists the codes of the records.
//!
//! The crate `mcap` (0.26.0) is not used. Its readers hold the largest record in memory, such as a camera image, and
//! stop at the first damage.

/// Codes that identify the kind of a record, from <https://mcap.dev/spec>.
pub(super) mod op {
    pub const FOOTER: u8 = 0x02;
    pub const SCHEMA: u8 = 0x03;
    pub const CHANNEL: u8 = 0x04;
    pub const MESSAGE: u8 = 0x05;
    pub const CHUNK: u8 = 0x06;
    pub const MESSAGE_INDEX: u8 = 0x07;
    pub const DATA_END: u8 = 0x0F;
    /// The first code of records that programs define themselves.
    pub const PRIVATE: u8 = 0x80;
}

/// The definition of a message type.
pub(super) struct Schema {
    pub id: u16,
    /// Name of the type, `package/msg/Type`.
    pub name: String,
    /// Language in which `text` defines the type.
    pub encoding: String,
    pub text: String,
}

/// The declaration of a channel, which carries messages of one topic.
pub(super) struct Channel {
    pub id: u16,
    pub schema: u16,
    pub topic: String,
    /// Encoding of the messages.
    pub encoding: String,
}

/// The `N` bytes of `view` from the index `at` on; `None` if there are fewer.
pub(super) fn bytes<const N: usize>(view: &[u8], at: usize) -> Option<[u8; N]> {
    view.get(at..)?.first_chunk().copied()
}

/// Reads a number from the beginning of `body` and removes it.
fn number(body: &mut &[u8]) -> Option<u16> {
    let (number, rest) = body.split_first_chunk()?;
    *body = rest;
    Some(u16::from_le_bytes(*number))
}

/// Reads a length and a text of this length from the beginning of `body` and removes both.
fn text(body: &mut &[u8]) -> Option<String> {
    let (length, rest) = body.split_first_chunk()?;
    let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    *body = rest;
    Some(String::from_utf8_lossy(text).into_owned())
}

/// Decodes the definition of a message type from the body of a record.
pub(super) fn schema(mut body: &[u8]) -> Option<Schema> {
    let body = &mut body;
    let (id, name) = (number(body)?, text(body)?);
    Some(Schema { id, name, encoding: text(body)?, text: text(body)? })
}

/// Decodes the declaration of a channel from the body of a record.
pub(super) fn channel(mut body: &[u8]) -> Option<Channel> {
    let body = &mut body;
    let (id, schema) = (number(body)?, number(body)?);
    Some(Channel { id, schema, topic: text(body)?, encoding: text(body)? })
}
