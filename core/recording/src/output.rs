//! The end that writes, for both kinds of recordings: chunks of JSON messages on topics with their schemas.

use crate::schema::Schema;
use mcap::records::MessageHeader;
use mcap::{McapResult, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::sync::Arc;

/// A chunk is closed when it has become this long, in bytes, if its time has not come before.
const CHUNK: u64 = 1 << 20;

/// A file that is being written.
pub(crate) struct Output {
    pub(crate) writer: Writer<BufWriter<File>>,
    pub(crate) file: Arc<File>,
}

impl Output {
    /// Begins an empty file; `program` writes it, with its version.
    ///
    /// # Errors
    /// As every function here: the disk is full or gone.
    pub(crate) fn begin(file: File, program: String) -> McapResult<Self> {
        let options =
            WriteOptions::new().profile("").library(program).chunk_size(Some(CHUNK)).compression_threads(0);
        let writer = options.create(BufWriter::new(file.try_clone()?))?;
        Ok(Self { writer, file: Arc::new(file) })
    }

    /// Makes a topic known, and what its messages look like; its channel.
    pub(crate) fn topic(&mut self, name: &str, schema: &Schema) -> McapResult<u16> {
        let schema = self.writer.add_schema(&schema.name, "jsonschema", &schema.text)?;
        self.writer.add_channel(schema, name, "json", &BTreeMap::new())
    }

    /// Writes a message that came at `log_ns`.
    pub(crate) fn message(
        &mut self,
        channel: u16,
        sequence: u32,
        log_ns: u64,
        data: &[u8],
    ) -> McapResult<()> {
        let header = MessageHeader { channel_id: channel, sequence, log_time: log_ns, publish_time: log_ns };
        self.writer.write_to_known_channel(&header, data)
    }

    /// Writes summary, statistics and index, and sees everything onto the disk.
    pub(crate) fn finish(&mut self) -> McapResult<()> {
        self.writer.finish()?;
        self.file.sync_all()?;
        Ok(())
    }
}
