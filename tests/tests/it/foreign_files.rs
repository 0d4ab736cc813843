//! Files that somebody else made: none may take the memory or hold up the program that reads it.

use fleet_tests::PATIENCE;
use fleet_tests::processes::{Process, program};
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Address space of a program that reads a foreign file, in KiB: it cannot take more.
const MEMORY_KIB: u64 = 700_000;

/// How a program ends that has no more memory than that, and what it says of what went wrong.
fn run(name: &str, args: &[&str]) -> (Option<i32>, String) {
    let mut command = Command::new("/bin/sh");
    command.env_clear().env("MALLOC_ARENA_MAX", "1").env("PATH", "/usr/bin:/bin");
    command
        .args(["-c", &format!("ulimit -v {MEMORY_KIB}; exec \"$0\" \"$@\"")])
        .arg(program(name))
        .args(args);
    let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut process = Process(child);
    let began = Instant::now();
    let status = loop {
        match process.0.try_wait().unwrap() {
            Some(status) => break status,
            None => assert!(began.elapsed() < PATIENCE, "{name} {args:?} does not end"),
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    let mut said = String::new();
    process.0.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    (status.code(), said)
}

/// A recording with channels of these names and one message of the first.
fn recording(path: &Path, topics: impl Iterator<Item = String>, message: &[u8]) {
    let options = WriteOptions::new().repeat_channels(false).repeat_schemas(false);
    let mut writer = Writer::with_options(fs::File::create(path).unwrap(), options).unwrap();
    let schema = writer.add_schema("xtb.RobotState", "jsonschema", b"{}").unwrap();
    let ids: Vec<u16> =
        topics.map(|topic| writer.add_channel(schema, &topic, "json", &BTreeMap::new()).unwrap()).collect();
    let header = MessageHeader { channel_id: ids[0], sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, message).unwrap();
    writer.finish().unwrap();
}

/// Every program that reads recordings refuses this one, and names the limit.
fn is_refused(path: &Path, folder: &Path, because: &str) {
    let (file, out) = (path.to_str().unwrap(), folder.join("out"));
    let played = ["play", file, "--dashboard", "127.0.0.1:0"];
    for (name, args) in [
        ("fleet-cli", &["export", file, "--csv", "--out", out.to_str().unwrap()][..]),
        ("fleet-cli", &played),
        ("robot-agent", &["replay", file]),
    ] {
        let (code, said) = run(name, args);
        assert!(code == Some(1) && said.contains(because), "{name} {args:?}: {code:?} {said}");
    }
}

#[test]
fn names_of_channels_that_fill_the_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("names.mcap");
    let long = |i: usize| format!("xtb/lab/xtb-{i}/{}", "x".repeat(16 << 20));
    recording(&path, (0..6).map(long), b"{}");
    let bytes = fs::metadata(&path).unwrap().len();
    assert!(bytes < 200_000, "{bytes}");
    is_refused(&path, folder.path(), "bytes of a channel: ");
    recording(&path, (0..24).map(|i| format!("xtb/lab/xtb-{i}/{}", "x".repeat(2000))), b"{}");
    is_refused(&path, folder.path(), "bytes of a name: 20");
    recording(&path, (0..5000).map(|i| format!("xtb/lab/xtb-{i}/state")), b"{}");
    is_refused(&path, folder.path(), "names of one kind: 4097, more than the limit of 4096");
}

#[test]
fn messages_that_fill_the_memory_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("messages.mcap");
    let topic = || std::iter::once("xtb/lab/xtb-1/state".to_owned());
    recording(&path, topic(), &vec![b' '; 40 << 20]);
    is_refused(&path, folder.path(), "bytes of a message: ");
    let many = format!("[{}0]", "{\"a\":0},".repeat(4_000_000));
    recording(&path, topic(), many.as_bytes());
    is_refused(&path, folder.path(), "values of a message: ");
}

#[test]
fn chunks_that_claim_to_be_huge_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chunk.mcap");
    for (declared, uncompressed) in [(u64::MAX - 8, 10_u64), (1 << 40, 1 << 40), (200, 1 << 60)] {
        let mut bytes = mcap::MAGIC.to_vec();
        // Header: no profile, no library.
        bytes.extend([1, 8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        bytes.push(6);
        bytes.extend(declared.to_le_bytes());
        for field in [0, 1, uncompressed] {
            bytes.extend(field.to_le_bytes());
        }
        bytes.extend(0_u32.to_le_bytes());
        bytes.extend(4_u32.to_le_bytes());
        bytes.extend(b"zstd");
        bytes.extend(160_u64.to_le_bytes());
        bytes.extend([0; 160]);
        fs::write(&path, bytes).unwrap();
        for (name, args) in [
            (
                "fleet-cli",
                &["export", path.to_str().unwrap(), "--csv", "--out", folder.path().to_str().unwrap()][..],
            ),
            ("robot-agent", &["replay", path.to_str().unwrap()]),
        ] {
            let (code, said) = run(name, args);
            assert_eq!(code, Some(1), "{name} {declared} {uncompressed}: {said}");
            assert!(!said.contains("memory"), "{said}");
        }
    }
}

/// What `map check` says of a map whose image is this, and what an agent with it.
fn map_says(folder: &Path, image: &str) -> [(Option<i32>, String); 2] {
    let yaml = folder.join("map.yaml");
    let text = format!(
        "image: {image}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    );
    fs::write(&yaml, text).unwrap();
    let setting = format!("navigation.map={:?}", yaml.to_str().unwrap());
    [
        run("fleet-cli", &["map", "check", yaml.to_str().unwrap()]),
        run("robot-agent", &["--hardware", "simulated", "--set", &setting, "--connect", "tcp/127.0.0.1:1"]),
    ]
}

#[test]
fn an_image_that_is_no_file_or_claims_to_be_huge_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
    rustix::fs::mknodat(rustix::fs::CWD, &pipe, rustix::fs::FileType::Fifo, mode, 0).unwrap();
    fs::write(folder.path().join("huge.pgm"), b"P5\n60000 60000\n255\n\0").unwrap();
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0x7F, 0xFF, 0xFF, 0xFF, 0x7F, 0xFF, 0xFF, 0xFF, 8, 0, 0, 0, 0, 0, 0, 0, 0]);
    fs::write(folder.path().join("huge.png"), png).unwrap();
    fs::File::create(folder.path().join("hole.pgm")).unwrap().set_len(1 << 40).unwrap();
    for (image, because) in [
        ("/dev/zero", "it is a device, not a file"),
        ("pipe", "it is a pipe, not a file"),
        (".", "it is a folder, not a file"),
        ("hole.pgm", "it is longer than"),
        ("huge.pgm", "60000 × 60000 pixels, the limit is"),
        ("huge.png", "2147483647 × 2147483647 pixels, the limit is"),
    ] {
        for (code, said) in map_says(folder.path(), image) {
            assert!(code.is_some_and(|code| code != 0) && said.contains(because), "{image}: {code:?} {said}");
        }
    }
}

#[test]
fn a_yaml_bomb_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n".to_owned();
    for i in 1..30 {
        let before = vec![format!("*a{}", i - 1); 9].join(", ");
        text.push_str(&format!("a{i}: &a{i} [{before}]\n"));
    }
    text.push_str("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n");
    text.push_str("occupied_thresh: 0.65\nfree_thresh: 0.196\n");
    let path = folder.path().join("bomb.yaml");
    fs::write(&path, text).unwrap();
    let (bomb, out) = (path.to_str().unwrap(), folder.path().join("out.yaml"));
    for args in [&["map", "check", bomb][..], &["plan", bomb, "--out", out.to_str().unwrap()]] {
        let (code, said) = run("fleet-cli", args);
        assert!(code.is_some_and(|code| code != 0), "{args:?}: {code:?} {said}");
    }
}

#[test]
fn files_of_settings_tasks_and_traces_are_regular_and_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let hole = folder.path().join("hole.toml");
    fs::File::create(&hole).unwrap().set_len(1 << 40).unwrap();
    let hole = hole.to_str().unwrap();
    for (name, args, because) in [
        ("robot-agent", &["--config", "/dev/zero", "--print-config"][..], "a device"),
        ("robot-agent", &["--config", hole, "--print-config"], "longer than"),
        ("robot-agent", &["replay", "--trace", "/dev/zero"], "a device"),
        ("robot-agent", &["replay", "--trace", hole], "longer than"),
        ("robot-agent", &["replay", "/dev/zero"], "a device"),
        ("fleet-cli", &["--config", "/dev/zero", "list"], "a device"),
        ("fleet-cli", &["sim", "--world", "/dev/zero"], "a device"),
        ("fleet-cli", &["sim", "--world", hole], "longer than"),
        ("fleet-cli", &["dispatch", "submit", "/dev/zero"], "a device"),
        ("fleet-cli", &["map", "check", hole], "longer than"),
        ("fleet-cli", &["export", "--csv", "/dev/zero"], "a device"),
    ] {
        let (code, said) = run(name, args);
        assert!(code.is_some_and(|code| code != 0), "{args:?}: {code:?}");
        assert!(said.contains(because), "{args:?}: {said}");
    }
}
