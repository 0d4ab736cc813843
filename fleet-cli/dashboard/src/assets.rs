//! The page's files, in the binary: what each is called, what it is, and how browsers keep it.

use axum::body::Body;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::Response;
use crc::{CRC_32_ISO_HDLC, Crc};
use std::sync::LazyLock;
use xtb_protocol::messages::texts;

const HTML: &str = "text/html; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SVG: &str = "image/svg+xml";
const TEXT: &str = "text/plain; charset=utf-8";

/// Where one signs in.
pub(super) const SIGN_IN: &str = "/sign-in";
/// One file of the page.
#[derive(Debug, Clone, Copy)]
struct Asset {
    /// Where it is.
    path: &'static str,
    content_type: &'static str,
    bytes: &'static [u8],
}

macro_rules! asset {
    ($file:literal, $content_type:expr) => {
        Asset {
            path: concat!("/assets/", $file),
            content_type: $content_type,
            bytes: include_bytes!(concat!("../page/", $file)),
        }
    };
}

const FILES: &[Asset] = &[
    Asset { path: SIGN_IN, content_type: HTML, bytes: include_bytes!("../page/sign_in.html") },
    Asset { path: "/", content_type: HTML, bytes: include_bytes!("../page/index.html") },
    asset!("alerts.js", JS),
    asset!("events.js", JS),
    asset!("goal_tool.js", JS),
    asset!("draw.js", JS),
    asset!("drive.js", JS),
    asset!("edit.css", CSS),
    asset!("edit_draw.js", JS),
    asset!("edit_panel.js", JS),
    asset!("edit_tool.js", JS),
    asset!("floor.js", JS),
    asset!("free_area.js", JS),
    asset!("gamepad.js", JS),
    asset!("press_hold.js", JS),
    asset!("icon.svg", SVG),
    asset!("link.js", JS),
    asset!("main.js", JS),
    asset!("map.css", CSS),
    asset!("map_draft.js", JS),
    asset!("map_editor.js", JS),
    asset!("frame_rate.js", JS),
    asset!("panels.js", JS),
    asset!("playback.css", CSS),
    asset!("playback.js", JS),
    asset!("plots.js", JS),
    asset!("pose_tool.js", JS),
    asset!("robot_filter.js", JS),
    asset!("robot_list.js", JS),
    asset!("robots.js", JS),
    asset!("shapes.js", JS),
    asset!("sign_in.js", JS),
    asset!("speed.js", JS),
    asset!("store.js", JS),
    asset!("style.css", CSS),
    asset!("tasks.js", JS),
    asset!("theme.js", JS),
    asset!("view.js", JS),
    asset!("who.js", JS),
    asset!("words.js", JS),
    asset!("vendor/LICENSE-d3.txt", TEXT),
    asset!("vendor/LICENSE-lit-html.txt", TEXT),
    asset!("vendor/LICENSE-uPlot.txt", TEXT),
    asset!("vendor/d3-color.min.js", JS),
    asset!("vendor/d3-dispatch.min.js", JS),
    asset!("vendor/d3-drag.min.js", JS),
    asset!("vendor/d3-ease.min.js", JS),
    asset!("vendor/d3-interpolate.min.js", JS),
    asset!("vendor/d3-selection.min.js", JS),
    asset!("vendor/d3-timer.min.js", JS),
    asset!("vendor/d3-transition.min.js", JS),
    asset!("vendor/d3-zoom.min.js", JS),
    asset!("vendor/directive-helpers.js", JS),
    asset!("vendor/directive.js", JS),
    asset!("vendor/lit-html.js", JS),
    asset!("vendor/uPlot.iife.min.js", JS),
    asset!("vendor/uPlot.min.css", CSS),
    asset!("vendor/directives/live.js", JS),
    asset!("vendor/directives/repeat.js", JS),
];

/// What people read for the protocol's names, from the table that the terminal uses too.
static TEXTS: LazyLock<String> = LazyLock::new(|| format!("export const TEXTS = {};\n", texts::tables()));

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let texts = Asset { path: "/assets/texts.js", content_type: JS, bytes: TEXTS.as_bytes() };
    FILES.iter().copied().chain([texts]).collect()
});

impl Asset {
    /// Changes with the content.
    fn tag(&self) -> String {
        let crc = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(self.bytes);
        format!("\"{crc:08x}-{:x}\"", self.bytes.len())
    }
}

/// The file at `path`, or that the browser has it already; `None` = there is no such file.
///
/// Browsers keep files and ask each time whether they still hold: a new binary shows at once.
#[must_use]
pub(super) fn answer(path: &str, headers: &HeaderMap) -> Option<Response> {
    let asset = ASSETS.iter().find(|asset| asset.path == path)?;
    let tag = asset.tag();
    let known = headers.get_all(header::IF_NONE_MATCH).iter().filter_map(|value| value.to_str().ok());
    let is_known = known.flat_map(|value| value.split(',')).any(|known| known.trim() == tag);
    let response = Response::builder()
        .header(header::CONTENT_TYPE, asset.content_type)
        .header(header::ETAG, tag)
        .header(header::CACHE_CONTROL, "no-cache");
    let response = match is_known {
        true => response.status(StatusCode::NOT_MODIFIED).body(Body::empty()),
        false => response.body(Body::from(asset.bytes)),
    };
    response.ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;
    use xtb_protocol::messages::StopReason;

    #[test]
    fn each_file_has_a_type_and_is_not_sent_again_to_who_has_it() {
        for asset in ASSETS.iter() {
            let first = answer(asset.path, &HeaderMap::new()).unwrap();
            assert_eq!(first.status(), StatusCode::OK, "{}", asset.path);
            assert_eq!(first.headers()[header::CONTENT_TYPE], asset.content_type);
            let tag = first.headers()[header::ETAG].clone();
            let has = HeaderMap::from_iter([(header::IF_NONE_MATCH, tag)]);
            assert_eq!(answer(asset.path, &has).unwrap().status(), StatusCode::NOT_MODIFIED);
            let old = HeaderMap::from_iter([(header::IF_NONE_MATCH, HeaderValue::from_static("\"0-0\""))]);
            assert_eq!(answer(asset.path, &old).unwrap().status(), StatusCode::OK);
        }
    }

    #[test]
    fn whatever_the_page_asks_for_is_in_the_table() {
        let mut asked = 0;
        for asset in ASSETS.iter().filter(|asset| [HTML, JS].contains(&asset.content_type)) {
            let folder = asset.path.rsplit_once('/').map_or("", |(folder, _)| folder);
            let text = String::from_utf8_lossy(asset.bytes);
            for word in text.split(['"', '\'', '`']) {
                let is_file = [".js", ".css", ".svg"].iter().any(|end| word.ends_with(end));
                let path = match word.strip_prefix("./") {
                    Some(beside) => format!("{folder}/{beside}"),
                    None => word.to_owned(),
                };
                if is_file && path.starts_with("/assets/") {
                    asked += 1;
                    assert!(ASSETS.iter().any(|asset| asset.path == path), "{word} in {}", asset.path);
                }
            }
        }
        assert!(asked > 10, "{asked}");
    }

    #[test]
    fn the_page_has_the_words_of_the_terminal() {
        let asset = ASSETS.iter().find(|asset| asset.path == "/assets/texts.js").unwrap();
        let script = String::from_utf8_lossy(asset.bytes);
        let table = script.strip_prefix("export const TEXTS = ").unwrap().trim_end().trim_end_matches(';');
        let table: serde_json::Value = serde_json::from_str(table).unwrap();
        for reason in StopReason::ALL {
            let name = serde_json::to_value(reason).unwrap();
            assert_eq!(table["stop_reason"][name.as_str().unwrap()]["text"], reason.text());
        }
    }

    #[test]
    fn there_is_no_way_out_of_the_table() {
        for path in ["/assets/../Cargo.toml", "/index.html/..", "", "//", "/etc/passwd"] {
            assert!(answer(path, &HeaderMap::new()).is_none(), "{path}");
        }
    }
}
