//! Plots as SVG, drawn here: two kinds, both with logarithmic axes, in colors that color-blind readers tell apart.

use std::fmt::Write as _;

use super::{Front, Growth, Study};

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 480.0;
/// Left, right, top and bottom of the field that is plotted in.
const FIELD: [f64; 4] = [78.0, 610.0, 56.0, 412.0];

/// Okabe and Ito's palette without its yellow.
const COLORS: [&str; 7] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#555555",
];

/// File names and contents of all plots of a study.
#[must_use]
pub fn plots(study: &Study) -> Vec<(String, String)> {
    let fronts = study
        .fronts
        .iter()
        .map(|front| (format!("{}.svg", front.work), of_front(front)));
    let growth = std::iter::once(("growth.svg".to_owned(), of_growth(&study.growth)));
    fronts.chain(growth).collect()
}

/// A logarithmic axis between two places on the page.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    /// Holds all values, with some air.
    fn new(values: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min).max(1e-9);
        let high = values.fold(0.0, f64::max).max(low * 1.5);
        let air = (high / low).powf(0.06).max(1.15);
        Self {
            low: low / air,
            high: high * air,
            from,
            to,
        }
    }

    fn at(&self, value: f64) -> f64 {
        let share = (value.max(self.low) / self.low).ln() / (self.high / self.low).ln();
        self.from + share * (self.to - self.from)
    }

    /// 1, 2 and 5 of every decade; only 1 where that is plenty.
    fn ticks(&self) -> Vec<f64> {
        let decades = (self.high / self.low).log10();
        let steps: &[f64] = if decades > 3.5 {
            &[1.0]
        } else {
            &[1.0, 2.0, 5.0]
        };
        #[allow(clippy::cast_possible_truncation)] // a few decades
        let first = self.low.log10().floor() as i32;
        (first..first + 12)
            .flat_map(|d| steps.iter().map(move |s| s * 10_f64.powi(d)))
            .filter(|v| (self.low..=self.high).contains(v))
            .collect()
    }
}

fn number(value: f64) -> String {
    if value >= 1000.0 {
        format!("{:.0} 000", value / 1000.0)
    } else if value >= 1.0 {
        format!("{value:.0}")
    } else {
        let digits = (-value.log10().floor()).clamp(1.0, 9.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few digits
        let digits = digits as usize;
        format!("{value:.digits$}")
    }
}

/// Text that may stand in XML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

fn begin(title: &str, subtitle: &str) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
         font-family=\"system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif\" font-size=\"13\" fill=\"#222\">\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n"
    );
    let _ = write!(
        svg,
        "<text x=\"{}\" y=\"26\" font-size=\"17\" font-weight=\"600\">{}</text>\n\
         <text x=\"{}\" y=\"45\" fill=\"#666\">{}</text>\n",
        FIELD[0],
        escaped(title),
        FIELD[0],
        escaped(subtitle)
    );
    svg
}

fn axes(svg: &mut String, x: &Axis, y: &Axis, x_name: &str, y_name: &str) {
    let [left, right, top, bottom] = FIELD;
    for tick in y.ticks() {
        let at = y.at(tick);
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#e6e6e6\"/><text x=\"{:.1}\" y=\"{:.1}\" \
             text-anchor=\"end\" fill=\"#555\">{}</text>",
            left - 8.0,
            at + 4.5,
            number(tick)
        );
    }
    for tick in x.ticks() {
        let at = x.at(tick);
        let _ = writeln!(
            svg,
            "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"#eee\"/><text x=\"{at:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\" fill=\"#555\">{}</text>",
            bottom + 19.0,
            number(tick)
        );
    }
    let _ = write!(
        svg,
        "<path d=\"M{left} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"#888\"/>\n\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n\
         <text transform=\"translate(22 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
        f64::midpoint(left, right),
        bottom + 44.0,
        escaped(x_name),
        f64::midpoint(top, bottom),
        escaped(y_name)
    );
}

fn of_front(front: &Front) -> String {
    let [left, right, top, bottom] = FIELD;
    let x = Axis::new(front.points.iter().map(|p| p.seconds * 1e3), left, right);
    let y = Axis::new(front.points.iter().map(|p| p.error), bottom, top);
    let mut svg = begin(
        &front.about,
        "nothing measured lies below the line: the Pareto front",
    );
    let (x_name, y_name) = (
        "time, milliseconds".to_owned(),
        format!("error, {}", front.unit),
    );
    axes(&mut svg, &x, &y, &x_name, &y_name);

    let mut line = String::new();
    for point in front.points.iter().filter(|p| p.on_front) {
        let (px, py) = (x.at(point.seconds * 1e3), y.at(point.error));
        if line.is_empty() {
            let _ = write!(line, "M{px:.1} {py:.1}");
        } else {
            let _ = write!(line, "H{px:.1}V{py:.1}");
        }
    }
    let _ = writeln!(
        svg,
        "<path d=\"{line}\" fill=\"none\" stroke=\"#222\" stroke-width=\"1.5\" stroke-opacity=\"0.55\"/>"
    );

    let mut knobs: Vec<&str> = Vec::new();
    for point in &front.points {
        if !knobs.contains(&point.knob.as_str()) && point.knob != "preset" {
            knobs.push(&point.knob);
        }
    }
    knobs.sort_unstable();
    for point in front.points.iter().filter(|p| p.knob != "preset") {
        let color = color_of(&knobs, &point.knob);
        let _ = writeln!(
            svg,
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{}\" fill=\"{color}\" fill-opacity=\"{}\"><title>{}: {:.2} ms, \
             {:.3} {}</title></circle>",
            x.at(point.seconds * 1e3),
            y.at(point.error),
            if point.on_front { 4.5 } else { 3.5 },
            if point.on_front { 1.0 } else { 0.55 },
            escaped(&point.label),
            point.seconds * 1e3,
            point.error,
            front.unit
        );
    }
    for (name, point) in front.presets() {
        let (px, py) = (x.at(point.seconds * 1e3), y.at(point.error));
        let (anchor, dx) = if px > right - 90.0 {
            ("end", -12.0)
        } else {
            ("start", 12.0)
        };
        let _ = writeln!(
            svg,
            "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"7.5\" fill=\"none\" stroke=\"#111\" stroke-width=\"2\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" font-weight=\"600\" stroke=\"#fff\" \
             stroke-width=\"4\" paint-order=\"stroke\">{name}</text>",
            px + dx,
            py - 9.0
        );
    }
    let mut at = top + 8.0;
    let _ = writeln!(
        svg,
        "<text x=\"{}\" y=\"{at:.1}\" fill=\"#666\">knob that is turned</text>",
        right + 26.0
    );
    for knob in &knobs {
        at += 22.0;
        let _ = writeln!(
            svg,
            "<circle cx=\"{}\" cy=\"{:.1}\" r=\"5\" fill=\"{}\"/><text x=\"{}\" y=\"{at:.1}\">{}</text>",
            right + 32.0,
            at - 4.5,
            color_of(&knobs, knob),
            right + 46.0,
            escaped(&knob.replace('_', " "))
        );
    }
    at += 30.0;
    let _ = writeln!(
        svg,
        "<circle cx=\"{}\" cy=\"{:.1}\" r=\"7\" fill=\"none\" stroke=\"#111\" stroke-width=\"2\"/><text x=\"{}\" \
         y=\"{at:.1}\">preset</text>\n</svg>",
        right + 32.0,
        at - 4.5,
        right + 46.0
    );
    svg
}

fn color_of(knobs: &[&str], knob: &str) -> &'static str {
    let place = knobs.iter().position(|k| *k == knob).unwrap_or(0);
    COLORS[place % COLORS.len()]
}

fn of_growth(growth: &[Growth]) -> String {
    let [left, right, top, bottom] = FIELD;
    let all = || growth.iter().flat_map(|g| g.points.iter());
    let relative = |g: &Growth| {
        let [size, seconds] = g.points.first().copied().unwrap_or([1.0; 2]);
        (size, seconds)
    };
    let sizes = growth
        .iter()
        .flat_map(|g| g.points.iter().map(move |p| p[0] / relative(g).0));
    let times = growth
        .iter()
        .flat_map(|g| g.points.iter().map(move |p| p[1] / relative(g).1));
    let x = Axis::new(sizes, left, right);
    let y = Axis::new(times, bottom, top);
    let mut svg = begin(
        "Time against size",
        "both relative to the smallest that was measured; dashed: proportional",
    );
    axes(
        &mut svg,
        &x,
        &y,
        "size, times the smallest",
        "time, times the least",
    );
    if all().next().is_some() {
        let end = x.high.min(y.high);
        let _ = writeln!(
            svg,
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"#999\" stroke-dasharray=\"5 5\"/>",
            x.at(1.0),
            y.at(1.0),
            x.at(end),
            y.at(end)
        );
    }
    let mut at = top + 8.0;
    for (g, color) in growth.iter().zip(COLORS.iter().cycle()) {
        let (size, seconds) = relative(g);
        let mut line = String::new();
        for point in &g.points {
            let (px, py) = (x.at(point[0] / size), y.at(point[1] / seconds));
            let _ = write!(
                line,
                "{}{px:.1} {py:.1}",
                if line.is_empty() { "M" } else { "L" }
            );
            let _ = writeln!(
                svg,
                "<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"4\" fill=\"{color}\"><title>{} {}: {:.2} ms</title></circle>",
                point[0],
                escaped(&g.with),
                point[1] * 1e3
            );
        }
        let _ = writeln!(
            svg,
            "<path d=\"{line}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\"/>\
             <circle cx=\"{}\" cy=\"{:.1}\" r=\"5\" fill=\"{color}\"/><text x=\"{}\" y=\"{at:.1}\">{}{}</text>",
            right + 22.0,
            at - 4.5,
            right + 34.0,
            escaped(&g.with),
            g.exponent
                .map_or(String::new(), |exponent| format!(": size^{exponent:.2}"))
        );
        at += 24.0;
    }
    svg.push_str("</svg>\n");
    svg
}
