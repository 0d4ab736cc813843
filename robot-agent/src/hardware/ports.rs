//! The serial ports of this machine: what they are, what to write into a configuration, who can use
//! them. For `robot-agent ports`; the control loop does not need it.

use super::serial::{PortError, probe};
use serde::Serialize;
use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo};
use std::cmp::Ordering;
use std::fmt;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Links named after device and serial number: they follow a device to another socket.
const BY_ID: &str = "/dev/serial/by-id";
/// Links named after the socket: for devices that do not differ in anything else.
const BY_PATH: &str = "/dev/serial/by-path";
/// Where Linux lists its ports.
const SYSTEM: &str = "/sys/class/tty";

/// A serial port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct PortEntry {
    /// The device, such as `/dev/ttyUSB0`. The number may be another one after the next start.
    pub path: String,
    /// A link to it that stays the same, which is what belongs into a configuration. Named after the
    /// device if that has a serial number, else after the socket it is plugged into.
    pub stable_path: Option<String>,
    /// What it is.
    pub kind: PortKind,
    /// Whether it can be used now.
    #[serde(rename = "use")]
    pub usage: PortUse,
}

/// What a port is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PortKind {
    /// A USB adapter, or a board with USB.
    Usb(UsbDevice),
    /// A PCI card.
    Pci,
    /// A Bluetooth link.
    Bluetooth,
    /// A port of the computer itself, or unknown.
    Unknown,
}

/// What a USB device says of itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UsbDevice {
    /// Vendor and product, four hexadecimal digits each, as `lsusb` shows them: `0403:6001`.
    pub id: String,
    /// Who made it.
    pub manufacturer: Option<String>,
    /// Its name.
    pub product: Option<String>,
    /// Its own number; cheap adapters have none.
    pub serial_number: Option<String>,
}

/// Whether a port can be used.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PortUse {
    /// Nobody holds it, as far as the system knows: a program that neither locks it nor claims it
    /// (TIOCEXCL) is not seen.
    Free,
    /// Another program holds it.
    Busy,
    /// This user may not open it; on most systems the group `dialout` may.
    NoPermission,
    /// It cannot be used; the system's words.
    Unusable(String),
}

impl fmt::Display for PortKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usb(device) => write!(f, "usb {device}"),
            Self::Pci => f.write_str("pci"),
            Self::Bluetooth => f.write_str("bluetooth"),
            Self::Unknown => f.write_str("unknown"),
        }
    }
}

impl fmt::Display for UsbDevice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.id)?;
        for word in [&self.manufacturer, &self.product].into_iter().flatten() {
            write!(f, " {word}")?;
        }
        match &self.serial_number {
            Some(number) => write!(f, " ({number})"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for PortUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Free => f.write_str("free"),
            Self::Busy => f.write_str("busy"),
            Self::NoPermission => f.write_str("no permission"),
            Self::Unusable(reason) => write!(f, "unusable: {reason}"),
        }
    }
}

/// The serial ports of this machine, `ttyUSB2` before `ttyUSB10`. Empty also if the system does not
/// list its ports. Ptys, such as those of `fleet-cli sim --pty`, are not among them.
///
/// To see whether a port is in use it is opened and locked for a moment, so one that nobody holds has
/// its modem lines (DTR, RTS) raised and lowered once: a board that resets at DTR does so. Nothing is
/// read, written or set. What the kernel lists without a device behind it is left out.
#[must_use]
pub fn list() -> Vec<PortEntry> {
    if cfg!(target_os = "linux") && !Path::new(SYSTEM).is_dir() {
        return Vec::new(); // a container may be without; the library would panic
    }
    let found = serialport::available_ports().unwrap_or_default();
    entries(found, &Links::read(Path::new(BY_ID), Path::new(BY_PATH)), probe)
}

/// The list, from what the system says.
fn entries(
    found: Vec<SerialPortInfo>,
    links: &Links,
    probe: impl Fn(&str) -> Result<(), PortError>,
) -> Vec<PortEntry> {
    let mut entries: Vec<_> = found.into_iter().filter_map(|port| entry(port, links, &probe)).collect();
    entries.sort_by(|a, b| natural(&a.path, &b.path));
    entries
}

fn entry(
    port: SerialPortInfo,
    links: &Links,
    probe: impl Fn(&str) -> Result<(), PortError>,
) -> Option<PortEntry> {
    let usage = match probe(&port.port_name) {
        Ok(()) => PortUse::Free,
        Err(error) => match error.kind {
            ErrorKind::NotFound => return None,
            ErrorKind::ResourceBusy => PortUse::Busy,
            ErrorKind::PermissionDenied => PortUse::NoPermission,
            _ => PortUse::Unusable(error.reason),
        },
    };
    let kind = kind(port.port_type);
    let stable_path = links.to(&port.port_name, &kind);
    Some(PortEntry { path: port.port_name, stable_path, kind, usage })
}

fn kind(system: SerialPortType) -> PortKind {
    match system {
        SerialPortType::UsbPort(info) => PortKind::Usb(usb(info)),
        SerialPortType::PciPort => PortKind::Pci,
        SerialPortType::BluetoothPort => PortKind::Bluetooth,
        SerialPortType::Unknown => PortKind::Unknown,
    }
}

fn usb(info: UsbPortInfo) -> UsbDevice {
    let said = |text: Option<String>| text.filter(|text| !text.is_empty());
    UsbDevice {
        id: format!("{:04x}:{:04x}", info.vid, info.pid),
        manufacturer: said(info.manufacturer),
        product: said(info.product),
        serial_number: said(info.serial_number),
    }
}

/// The links that udev makes, each with the device it points to.
#[derive(Debug, Default)]
struct Links {
    by_id: Vec<Link>,
    by_path: Vec<Link>,
}

#[derive(Debug)]
struct Link {
    link: PathBuf,
    device: PathBuf,
}

impl Links {
    fn read(by_id: &Path, by_path: &Path) -> Self {
        Self { by_id: links_in(by_id), by_path: links_in(by_path) }
    }

    /// Two devices of a type without serial numbers share one link by id: then the socket's is meant.
    fn to(&self, device: &str, kind: &PortKind) -> Option<String> {
        let nameless = matches!(kind, PortKind::Usb(usb) if usb.serial_number.is_none());
        let (first, second) =
            if nameless { (&self.by_path, &self.by_id) } else { (&self.by_id, &self.by_path) };
        let device = Path::new(device);
        let link = first.iter().chain(second).find(|link| link.device == device)?;
        Some(link.link.display().to_string())
    }
}

/// The links in a folder by name; none if there is no such folder.
fn links_in(folder: &Path) -> Vec<Link> {
    let Ok(read) = folder.read_dir() else { return Vec::new() };
    let mut links: Vec<_> = read
        .filter_map(|entry| {
            let link = entry.ok()?.path();
            let device = link.canonicalize().ok()?;
            Some(Link { link, device })
        })
        .collect();
    links.sort_by(|a, b| a.link.cmp(&b.link));
    links
}

/// Numbers inside a text count as numbers.
fn natural(a: &str, b: &str) -> Ordering {
    pieces(a).cmp(pieces(b)).then_with(|| a.cmp(b))
}

#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Piece<'a> {
    Number(u64),
    Text(&'a [u8]),
}

fn pieces(text: &str) -> impl Iterator<Item = Piece<'_>> {
    text.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()).map(|piece| {
        let number = str::from_utf8(piece).ok().and_then(|digits| digits.parse().ok());
        number.map_or(Piece::Text(piece), Piece::Number)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn usb_port(path: &str, serial_number: Option<&str>) -> SerialPortInfo {
        let port_type = SerialPortType::UsbPort(UsbPortInfo {
            vid: 0x0403,
            pid: 0x6001,
            serial_number: serial_number.map(str::to_owned),
            manufacturer: Some("FTDI".to_owned()),
            product: Some("FT232R".to_owned()),
        });
        SerialPortInfo { port_name: path.to_owned(), port_type }
    }

    fn plain(path: &str, port_type: SerialPortType) -> SerialPortInfo {
        SerialPortInfo { port_name: path.to_owned(), port_type }
    }

    fn refused(path: &str, kind: ErrorKind, reason: &str) -> Result<(), PortError> {
        Err(PortError { path: path.to_owned(), kind, reason: reason.to_owned() })
    }

    fn link(link: &str, device: &str) -> Link {
        Link { link: link.into(), device: device.into() }
    }

    #[test]
    fn numbers_count_as_numbers() {
        let mut paths = ["/dev/ttyUSB10", "/dev/ttyS1", "/dev/ttyUSB2", "/dev/ttyACM0", "/dev/ttyUSB02"];
        paths.sort_by(|a, b| natural(a, b));
        assert_eq!(paths, ["/dev/ttyACM0", "/dev/ttyS1", "/dev/ttyUSB02", "/dev/ttyUSB2", "/dev/ttyUSB10"]);
    }

    #[test]
    fn the_list_is_sorted_and_says_who_can_use_what() {
        let found = vec![
            usb_port("/dev/ttyUSB10", Some("A50285BI")),
            usb_port("/dev/ttyUSB2", None),
            plain("/dev/ttyS0", SerialPortType::Unknown),
            plain("/dev/ttyS1", SerialPortType::Unknown),
            plain("/dev/ttyS4", SerialPortType::PciPort),
            plain("/dev/rfcomm0", SerialPortType::BluetoothPort),
        ];
        let entries = entries(found, &Links::default(), |path| match path {
            "/dev/ttyUSB10" => refused(path, ErrorKind::ResourceBusy, "in use by another program"),
            "/dev/ttyS0" => refused(path, ErrorKind::PermissionDenied, "permission denied"),
            "/dev/ttyS1" => refused(path, ErrorKind::NotFound, "no such device"),
            "/dev/ttyS4" => refused(path, ErrorKind::Other, "odd"),
            _ => Ok(()),
        });
        let lines: Vec<_> = entries.iter().map(|e| format!("{} {}: {}", e.path, e.kind, e.usage)).collect();
        let expected = [
            "/dev/rfcomm0 bluetooth: free",
            "/dev/ttyS0 unknown: no permission",
            "/dev/ttyS4 pci: unusable: odd",
            "/dev/ttyUSB2 usb 0403:6001 FTDI FT232R: free",
            "/dev/ttyUSB10 usb 0403:6001 FTDI FT232R (A50285BI): busy",
        ];
        assert_eq!(lines, expected);
    }

    #[test]
    fn the_link_names_the_device_if_it_has_a_number_else_the_socket() {
        let links = Links {
            by_id: vec![link("id/numbered", "/dev/ttyUSB0"), link("id/nameless", "/dev/ttyUSB1")],
            by_path: vec![link("path/1", "/dev/ttyUSB0"), link("path/2", "/dev/ttyUSB1")],
        };
        let found = vec![
            usb_port("/dev/ttyUSB0", Some("A50285BI")),
            usb_port("/dev/ttyUSB1", Some("")),
            usb_port("/dev/ttyUSB3", None),
        ];
        let entries = entries(found, &links, |_| Ok(()));
        let stable: Vec<_> = entries.iter().map(|entry| entry.stable_path.as_deref()).collect();
        assert_eq!(stable, [Some("id/numbered"), Some("path/2"), None]);
    }

    #[test]
    fn links_are_read_from_a_folder() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let device = folder.path().join("ttyUSB0");
        std::fs::write(&device, "").expect("a file");
        let by_id = folder.path().join("by-id");
        std::fs::create_dir(&by_id).expect("a folder");
        symlink("../ttyUSB0", by_id.join("usb-FTDI")).expect("a link");
        symlink("../ttyUSB9", by_id.join("dangling")).expect("a link");
        let links = Links::read(&by_id, &folder.path().join("by-path"));
        let device = device.canonicalize().expect("a file");
        let found = links.to(&device.display().to_string(), &PortKind::Unknown);
        assert_eq!(found, Some(by_id.join("usb-FTDI").display().to_string()));
        assert_eq!(links.by_id.len(), 1);
    }

    #[test]
    fn an_entry_is_written_with_plain_names() {
        let entries = entries(vec![usb_port("/dev/ttyUSB0", None)], &Links::default(), |_| Ok(()));
        let written = toml::to_string(&entries[0]).expect("an entry can be written");
        let expected = "path = \"/dev/ttyUSB0\"\nuse = \"free\"\n\n[kind.usb]\nid = \"0403:6001\"\n\
                        manufacturer = \"FTDI\"\nproduct = \"FT232R\"\n";
        assert_eq!(written, expected);
    }
}
