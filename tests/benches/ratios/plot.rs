//! The accepted runs as SVG: a panel for each figure, each ratio divided by its first accepted one.

use fleet_tests::ratios::{FALL, Figure, Run, courses};
use plotters::coord::Shift;
use plotters::prelude::*;

const COLUMNS: usize = 4;
/// A panel, in pixels.
const PANEL: (u32, u32) = (300, 170);
/// Height of the title.
const TITLE: u32 = 56;
const FONT: &str = "sans-serif";
const INK: RGBColor = RGBColor(0x1f, 0x29, 0x33);
const GREY: RGBColor = RGBColor(0x7b, 0x87, 0x94);
const PALE: RGBColor = RGBColor(0xe4, 0xe7, 0xeb);
const BLUE: RGBColor = RGBColor(0x1f, 0x5f, 0xbf);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// The drawing.
pub(crate) fn svg(history: &[Run]) -> String {
    let rows = Figure::ALL.len().div_ceil(COLUMNS);
    let size = (PANEL.0 * COLUMNS as u32, TITLE + PANEL.1 * rows as u32);
    let mut svg = String::new();
    // Into a string, and with no fonts to load, nothing can fail.
    let _ = draw(&SVGBackend::with_string(&mut svg, size).into_drawing_area(), history, rows);
    svg
}

fn draw(root: &Area<'_>, history: &[Run], rows: usize) -> Drawn {
    root.fill(&WHITE)?;
    let runs: Vec<&Run> = history.iter().filter(|run| run.profile == "bench").collect();
    let about = match (runs.first(), runs.last()) {
        (Some(first), Some(last)) => {
            format!(
                "{} runs, {} ({}) to {} ({})",
                runs.len(),
                first.date,
                first.commit,
                last.date,
                last.commit
            )
        }
        _ => "no accepted run".to_owned(),
    };
    let title = (FONT, 20).into_font().color(&INK);
    root.draw_text("Speed beside the reference work, relative to the first accepted run", &title, (12, 8))?;
    let small = (FONT, 15).into_font().color(&GREY);
    root.draw_text(&format!("{about}; dashed: 25 % less"), &small, (12, 34))?;
    let (_, panels) = root.split_vertically(TITLE);
    let courses = courses(history, "bench");
    for (figure, area) in Figure::ALL.into_iter().zip(panels.split_evenly((rows, COLUMNS))) {
        panel(&area, figure, courses.get(figure.name()).map_or(&[][..], Vec::as_slice), runs.len())?;
    }
    root.present()
}

fn panel(area: &Area<'_>, figure: Figure, course: &[(usize, f64)], runs: usize) -> Drawn {
    area.draw_text(figure.name(), &(FONT, 15).into_font().color(&INK), (12, 4))?;
    let points: Vec<(f64, f64)> = course.iter().map(|&(run, ratio)| (run as f64, ratio)).collect();
    let highest = points.iter().map(|(_, ratio)| *ratio).fold(1.25, f64::max);
    let last_run = runs.max(2) as f64 - 1.0;
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .margin_top(24)
        .x_label_area_size(4)
        .y_label_area_size(40)
        .build_cartesian_2d(-0.1..last_run + 0.1, 0.0..highest * 1.1)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(PALE)
        .axis_style(GREY)
        .x_labels(0)
        .y_labels(4)
        .y_label_formatter(&|ratio: &f64| format!("{ratio:.1}"))
        .label_style((FONT, 13, &INK))
        .draw()?;
    let limit = [(0.0, 1.0 - FALL), (last_run, 1.0 - FALL)];
    chart.draw_series(DashedLineSeries::new(limit, 5, 4, GREY.stroke_width(1)))?;
    chart.draw_series(LineSeries::new(points.iter().copied(), BLUE.stroke_width(2)))?;
    chart.draw_series(points.iter().map(|point| Circle::new(*point, 3, BLUE.filled())))?;
    Ok(())
}
