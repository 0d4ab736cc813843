//! The files of map_server.

use crate::any;
use proptest::prelude::*;
use xtb_nav::map::ros::{Description, Files, RosError};
use xtb_nav::{Cell, Grid, Map, ZoneKind};

const YAML: &str = "image: lab.pgm\nmode: trinary\nresolution: 0.05\norigin: [-1.5, -2, 0]\nnegate: 0\n\
                    occupied_thresh: 0.65\nfree_thresh: 0.196\n";

fn read(yaml: &str, image: &[u8]) -> Result<Map, RosError> {
    Description::from_yaml(yaml)?.map("file", image)
}

fn refused(yaml: &str, image: &[u8]) -> String {
    read(yaml, image).unwrap_err().to_string()
}

fn png(width: u32, height: u32, color: png::ColorType, bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(color);
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    out
}

#[test]
fn every_kind_of_the_family_is_read_as_its_pixels_are() {
    use Cell::{Free, Occupied};
    for image in [
        b"P1 2 2\n01\n# between\n1 0".as_slice(),
        b"P4 2 2\n\x40\x80",
        b"P2 2 2 7\n7 0 0 7",
        b"P3 2 2 9 9 9 9 0 0 0 0 0 0 9 9 9",
        b"P5 2 2 7\n\x07\x00\x00\x07",
        b"P6 2 2 255\n\xff\xff\xff\0\0\0\0\0\0\xff\xff\xff",
    ] {
        assert_eq!(read(YAML, image).unwrap().grid().cells(), [Occupied, Free, Free, Occupied], "{image:?}");
    }
    for (image, reason) in [
        (b"P2 1 1 7 8".as_slice(), "a sample of 8 is above its maximum of 7"),
        (b"P2 1 1 0 0", "its maximum must be 1 to 65535"),
        (b"P5 2 2 255\n\0", "it ends after 1 of 4 samples"),
        (b"P1 2 1 02", "sample 2 of 2 is not a number"),
        (b"P5 # 2", "it has no width"),
        (b"P5 0 2 255\n", "it has no pixels"),
    ] {
        let said = refused(YAML, image);
        assert!(said.starts_with(&format!("the image: {reason}")), "{said}");
    }
}

#[test]
fn rows_run_from_north_to_south_and_shades_are_free_unknown_and_occupied() {
    let plain = b"P2\n# made by hand\n3 2\n255\n254 205 0\n0 100 89\n";
    let map = read(YAML, plain).unwrap();
    assert_eq!((map.name(), map.grid().width(), map.grid().height()), ("file", 3, 2));
    assert_eq!(map.grid().origin_m(), [-1.5, -2.0]);
    use Cell::{Free, Occupied, Unknown};
    // 89 is the darkest grey that is above the threshold of 0.65.
    assert_eq!(map.grid().cells(), [Occupied, Unknown, Occupied, Free, Unknown, Occupied]);
    let raw = [b"P5 3 2 255\n".as_slice(), &[254, 205, 0, 0, 100, 89]].concat();
    assert_eq!(read(YAML, &raw).unwrap(), map);
    let grey = png(3, 2, png::ColorType::Grayscale, &[254, 205, 0, 0, 100, 89]);
    assert_eq!(read(YAML, &grey).unwrap(), map);
}

#[test]
fn the_image_may_be_coloured_deep_or_negated() {
    let coloured = png(2, 1, png::ColorType::Rgb, &[250, 255, 254, 10, 0, 40]);
    assert_eq!(read(YAML, &coloured).unwrap().grid().cells(), [Cell::Free, Cell::Occupied]);
    let deep = [b"P5 2 1 65535\n".as_slice(), &[0xff, 0xf0, 0x00, 0x10]].concat();
    assert_eq!(read(YAML, &deep).unwrap().grid().cells(), [Cell::Free, Cell::Occupied]);
    for negate in ["1", "true"] {
        let yaml = YAML.replace("negate: 0", &format!("negate: {negate}"));
        assert_eq!(read(&yaml, &deep).unwrap().grid().cells(), [Cell::Occupied, Cell::Free]);
    }
    // As map_server does, alpha counts as one channel of the mean: what is transparent is not free.
    let clear = png(2, 1, png::ColorType::GrayscaleAlpha, &[254, 0, 254, 255]);
    assert_eq!(read(YAML, &clear).unwrap().grid().cells(), [Cell::Unknown, Cell::Free]);
}

#[test]
fn what_is_not_read_is_refused_with_the_part_and_the_reason() {
    let image = b"P5 1 1 255\n\x00";
    let cases = [
        ("mode: trinary", "mode: scale", "the YAML's mode: \"scale\" has values between"),
        ("mode: trinary", "mode: raw", "the YAML's mode: \"raw\" has values between"),
        ("mode: trinary", "mode: rgb", "the YAML's mode: \"rgb\" is none of trinary, scale and raw"),
        ("-2, 0]", "-2, 0.1]", "the YAML's origin: a yaw of 0.1 rad: rotated maps are not supported"),
        ("-2, 0]", "-2]", "the YAML's origin: 2 numbers, [x, y, yaw] are needed"),
        ("0.196", "0.7", "the YAML's free_thresh: 0.7 and occupied_thresh 0.65 must rise within 0 to 1"),
        ("resolution: 0.05", "resolution: .nan", "the image and the YAML's resolution and origin:"),
        ("resolution: 0.05", "resolution: 0", "the image and the YAML's resolution and origin:"),
        ("resolution: 0.05\n", "", "the YAML: "),
        ("negate: 0", "negate: 2", "the YAML: "),
    ];
    for (from, to, reason) in cases {
        let said = refused(&YAML.replace(from, to), image);
        assert!(said.starts_with(reason), "{to}: {said}");
    }
    assert_eq!(refused(YAML, b"GIF89a"), "the image: neither PNG nor PGM");
    assert!(refused(YAML, b"P5 2 2 255\n\x00").starts_with("the image: "));
    assert!(refused(YAML, b"P5 5000 5000 255\n").starts_with("the image: 5000 × 5000 pixels, the limit is"));
    let mut huge = png(1, 1, png::ColorType::Grayscale, &[0]);
    huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    assert!(refused(YAML, &huge).starts_with("the image: 2147483647 × 2147483647 pixels"));
    let bow = "zones:\n- {name: bow, kind: keep_out, points: [[0, 0], [1, 1], [1, 0], [0, 1]]}\n";
    assert!(refused(&format!("{YAML}{bow}"), image).contains("zone \"bow\": the side from point 1"));
    let lane = "zones:\n- {name: lane, kind: one_way, points: [[0, 0], [1, 1], [1, 0]]}\n";
    assert!(refused(&format!("{YAML}{lane}"), image).contains("a one_way needs heading_rad"));
}

#[test]
fn our_keys_are_name_and_zones_and_other_keys_are_skipped() {
    let ours = "name: lab\nspeed_mask: other.pgm\nzones:\n- name: lane\n  kind: one_way\n  heading_rad: 1.5\n  \
                points: [[0, 0], [1, 1], [1, 0]]\n- {name: charger, kind: keep_out, points: [[3, 0], [4, 1], [4, 0]]}\n";
    let map = read(&format!("{YAML}{ours}"), b"P5 1 1 255\n\x00").unwrap();
    assert_eq!(map.name(), "lab");
    let kinds: Vec<_> = map.zones().iter().map(|zone| (zone.name(), zone.kind())).collect();
    assert_eq!(kinds, [("lane", ZoneKind::OneWay { heading_rad: 1.5 }), ("charger", ZoneKind::KeepOut)]);
}

#[test]
fn files_are_as_map_saver_writes_them() {
    let cells = vec![Cell::Occupied, Cell::Free, Cell::Unknown, Cell::Free];
    let map = Map::new("lab", Grid::new(0.05, [-6.1, 0.0], 2, 2, cells).unwrap(), Vec::new()).unwrap();
    let files = Files::of(&map, "lab.pgm").unwrap();
    let yaml = "image: lab.pgm\nmode: trinary\nresolution: 0.05\norigin: [-6.1, 0.0, 0.0]\nnegate: 0\n\
                occupied_thresh: 0.65\nfree_thresh: 0.196\nname: lab\n";
    assert_eq!(files.yaml, yaml);
    assert_eq!(files.image, b"P5\n2 2 255\n\xcd\xfe\x00\xfe");
}

proptest! {
    #[test]
    fn what_was_written_is_read_back_exactly(map in any::map()) {
        let files = Files::of(&map, "a b: #.pgm").unwrap();
        let description = Description::from_yaml(&files.yaml).unwrap();
        prop_assert_eq!(description.image(), "a b: #.pgm");
        let again = description.map("other", &files.image).unwrap();
        prop_assert_eq!(again.hash(), map.hash());
        prop_assert_eq!(again, map);
    }

    #[test]
    fn garbage_is_refused_without_a_panic(
        yaml in ".{0,200}",
        image in prop::collection::vec(any::<u8>(), 0..200),
        kind in 0..4_usize,
    ) {
        let _ = Description::from_yaml(&yaml);
        let magic = [b"P5 ".as_slice(), b"P2 3 3 255 ", b"\x89PNG\r\n\x1a\n", b""][kind];
        let image = [magic, &image].concat();
        let _ = read(YAML, &image);
    }

    #[test]
    fn damaged_files_are_refused_or_read_without_a_panic(
        map in any::map(), at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<prop::sample::Index>(),
    ) {
        let Files { yaml, mut image } = Files::of(&map, "m.pgm").unwrap();
        let mut text = yaml.clone().into_bytes();
        let i = at.index(text.len());
        text[i] = byte;
        text.truncate(cut.index(text.len()) + 1);
        let _ = read(&String::from_utf8_lossy(&text), &image);
        let i = at.index(image.len().min(20));
        image[i] = byte;
        let _ = read(&yaml, &image);
    }
}
