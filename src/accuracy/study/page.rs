//! The study as a page for people, Markdown.

use std::fmt::Write as _;

use super::{Front, Point, Study};

/// The page; the plots lie beside it.
#[must_use]
pub fn page(study: &Study) -> String {
    let mut page = String::from(
        "# What accuracy costs\n\n\
         More accuracy takes more time. This page shows how much, as measured on one machine with one set of paints, so \
         that you can choose by looking instead of by guessing. Each dot is one setting. A dot to the left is faster, a \
         dot further down is more accurate; the line joins the settings that nothing else beats in both.\n\n",
    );
    let _ = write!(
        page,
        "Measured with carpaint {} on {} threads, with {}. Times are {}, {}. The same for your machine and your paints: \
         `carpaint study --out DIR PAINT...`. Put its `study.json` into the service's data folder, and `GET /v1/accuracy` \
         serves it.\n\n",
        study.program,
        study.threads,
        list(&study.paints),
        study.clock,
        if study.quick {
            "of one go or two: this is a quick study, of fewer settings and smaller pictures"
        } else {
            "the shortest of several goes"
        }
    );
    at_a_glance(&mut page, study);
    for front in &study.fronts {
        section(&mut page, front);
    }
    growth(&mut page, study);
    page.push_str(
        "## How to read the errors\n\n\
         - **Lab** is a distance between colors as people see them; 1 is about what a trained eye tells apart side by side. \
         Flakes are distributions of color, and the distance of two distributions (W1) is how far the average texel would \
         have to move to turn one into the other. Between pixels and clusters it is measured along lightness, which is \
         what sparkles. What each step misplaces is added up: pixels to clusters, detours between paints, rounding in the \
         file.\n\
         - **CIEDE2000** is the color difference of paint tolerances. For pictures it is the mean over all pixels between \
         the picture and one of very many samples. FLIP (0 to 1) weighs what is seen when two pictures alternate on a screen.\n\
         - Every result carries its own error: `carpaint show`, `material.json`, the answers of the service. \
         `carpaint estimate` tells seconds, bytes and error beforehand, and `--max-error` or `--max-seconds` picks the \
         profile for you.\n",
    );
    page
}

fn list(names: &[String]) -> String {
    match names {
        [] => "no paints".to_owned(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} and {last}", all.join(", ")),
    }
}

fn at_a_glance(page: &mut String, study: &Study) {
    page.push_str("## At a glance\n\n| | draft | standard | reference |\n|---|---|---|---|\n");
    for front in &study.fronts {
        let cell = |name: &str| {
            front.preset(name).map_or_else(
                || "–".to_owned(),
                |p| format!("{}, {} {}", time(p.seconds), error(p.error), front.unit),
            )
        };
        let _ = writeln!(
            page,
            "| {} | {} | **{}** | {} |",
            front.work,
            cell("draft"),
            cell("standard"),
            cell("reference")
        );
    }
    page.push('\n');
    page.push_str(&choice(study));
}

/// What a trained eye tells apart side by side, in Lab and in CIEDE2000.
const VISIBLE: f64 = 1.0;

/// How the presets were chosen, and how far this study bears that out.
fn choice(study: &Study) -> String {
    let of = |name: &'static str| {
        let points = study.fronts.iter().filter_map(move |f| f.preset(name));
        points.collect::<Vec<_>>()
    };
    let most = |name| of(name).iter().map(|p| p.error).fold(0.0, f64::max);
    let against_standard = |name: &'static str, what: fn(&Point) -> f64| {
        let pairs = study.fronts.iter();
        let pairs = pairs.filter_map(|f| Some((f.preset(name)?, f.preset("standard")?)));
        let ratios: Vec<f64> = pairs.map(|(own, of)| what(own) / what(of)).collect();
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let most = ratios.iter().copied().fold(0.0, f64::max);
        format!("{least:.1} to {most:.1} times")
    };
    let beaten = study.fronts.iter().filter(|front| {
        let standard = front.preset("standard");
        standard.is_some_and(|point| front.beaten_by(point).is_some())
    });
    let knees: Vec<String> = study
        .fronts
        .iter()
        .map(|front| format!("{} {}", front.work, at_knee(front)))
        .collect();
    let mut fronts = study.fronts.iter();
    let at_knee_of_blending = fronts.any(|f| f.work == "blend" && f.knee == "standard");
    let (most_of_standard, all) = (most("standard"), study.fronts.len());
    format!(
        "The presets were chosen from such fronts. `standard` is for every day: its errors, {} at most here in Lab or CIEDE2000, {} the \
         {VISIBLE} that a trained eye tells apart side by side; something measured beats it in {} of {all} kinds of work. \
         The knees, from which on a share of the front's time buys less than that share of its error, are here (on linear axes, \
         those of the plots are logarithmic): {}. {} `draft` is for trying out: {} \
         the time of `standard`, errors up to {}. `reference` is what the others are compared with: {} the time of \
         `standard`, {} its error.\n\n",
        error(most_of_standard),
        if most_of_standard < VISIBLE {
            "stay below"
        } else {
            "exceed"
        },
        beaten.count(),
        knees.join(", "),
        if at_knee_of_blending {
            "`standard` is one profile for all kinds of work: it is the knee of blending, which is done anew for every pair of paints, \
             and its files hold both tables that flakes can be drawn by."
        } else {
            "They differ from paint to paint and from one kind of work to another; `standard` is one profile for all of them, chosen at \
             the knee of blending of the study that comes with carpaint."
        },
        against_standard("draft", |p| p.seconds),
        error(most("draft")),
        against_standard("reference", |p| p.seconds),
        against_standard("reference", |p| p.error),
    )
}

/// Where the knee of a front is.
fn at_knee(front: &Front) -> String {
    if is_preset(&front.knee) {
        format!("`{}`", front.knee)
    } else {
        format!("at {}", front.knee)
    }
}

fn section(page: &mut String, front: &Front) {
    let _ = write!(
        page,
        "## {}\n\n![Error against time]({}.svg)\n\n{}\n\n",
        front.about, front.work, front.error_is
    );
    page.push_str(&verdict(front));
    page.push('\n');
    let told = |p: &&Point| p.on_front || is_preset(p.label.as_str());
    table(page, front, front.points.iter().filter(told));
    page.push_str("\n<details><summary>Everything that was measured</summary>\n\n");
    table(page, front, front.points.iter());
    page.push_str("\n</details>\n\n");
}

/// Settings with what they take and how far they are off; without sizes where the work has none.
fn table<'a>(page: &mut String, front: &Front, points: impl Iterator<Item = &'a Point>) {
    let has_size = front.points.iter().any(|p| p.bytes.is_some());
    let (head, line) = if has_size {
        (" size |", "---:|")
    } else {
        ("", "")
    };
    let _ = writeln!(
        page,
        "| setting | time | error |{head}\n|---|---:|---:|{line}"
    );
    for point in points {
        let mark = match (is_preset(&point.label), point.label == front.knee) {
            (true, true) => format!("**{}** (knee)", point.label),
            (true, false) => format!("**{}**", point.label),
            (false, true) => format!("{} (knee)", point.label),
            (false, false) => point.label.clone(),
        };
        let mut error = error(point.error);
        for (name, value) in &point.more {
            let _ = write!(error, ", {name} {value:.3}");
        }
        let _ = write!(page, "| {mark} | {} | {error} |", time(point.seconds));
        if has_size {
            let _ = write!(page, " {} |", point.bytes.map_or_else(String::new, size));
        }
        page.push('\n');
    }
}

fn is_preset(label: &str) -> bool {
    crate::accuracy::PRESETS.contains(&label)
}

/// Where the presets stand, and whether `standard` is the knee.
fn verdict(front: &Front) -> String {
    let mut said = String::new();
    for (name, point) in front.presets() {
        let stands = match front.beaten_by(point) {
            None if point.on_front => "stands on the front".to_owned(),
            None => "stands within a tenth of the front".to_owned(),
            Some(other) => format!(
                "is beaten by {}: {:.1} times the time, {:.1} times the error",
                other.label,
                other.seconds / point.seconds,
                other.error / point.error
            ),
        };
        let _ = writeln!(said, "- `{name}` {stands}.");
    }
    if front.knee == "standard" {
        said.push_str(
            "- The knee of this front is `standard` itself: beyond it, a share of the time buys less than that share of \
             the error. That is why it is the default.\n",
        );
    } else if !front.knee.is_empty() {
        let _ = writeln!(
            said,
            "- The knee of this front, from which on a share of the time buys less than that share of the error, is {}.",
            at_knee(front)
        );
        said.push_str(&beside_knee(front).unwrap_or_default());
    }
    said
}

/// What `standard` gives and takes beside the knee.
fn beside_knee(front: &Front) -> Option<String> {
    let standard = front.preset("standard")?;
    let knee = front.points.iter().find(|p| p.label == front.knee)?;
    let difference = standard.error - knee.error;
    Some(format!(
        "- Beside it `standard` takes {:.1} times the time for an error that is {} {} {}.\n",
        standard.seconds / knee.seconds.max(1e-9),
        error(difference.abs()),
        front.unit,
        if difference > 0.0 {
            "larger"
        } else {
            "smaller"
        }
    ))
}

fn growth(page: &mut String, study: &Study) {
    page.push_str(
        "## How time grows\n\n![Time against size](growth.svg)\n\nExponents scatter by a tenth from run to run; what is \
         above its limit by less counts as kept. What is said of a blend alone begins with ingested paints; the row \
         without that has the pictures too, and the blend is a part of it.\n\n| with | what is done | from | to | time grows as | \
         should be at most |\n|---|---|---:|---:|---|---|\n",
    );
    for growth in &study.growth {
        let end = |p: Option<&[f64; 2]>| {
            p.map_or_else(String::new, |[size, seconds]| {
                format!("{size:.0}: {}", time(*seconds))
            })
        };
        let grows = growth.exponent.map_or_else(
            || "not told by so few sizes".to_owned(),
            |exponent| format!("size^{exponent:.2}"),
        );
        let missed = !growth.is_within();
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {grows} | size^{:.1}{} |",
            growth.with,
            growth.about,
            end(growth.points.first()),
            end(growth.points.last()),
            growth.limit,
            if missed { " (missed)" } else { "" }
        );
    }
    page.push('\n');
}

fn time(seconds: f64) -> String {
    if seconds >= 1.0 {
        format!("{seconds:.2} s")
    } else if seconds >= 0.1 {
        format!("{:.0} ms", seconds * 1e3)
    } else {
        format!("{:.1} ms", seconds * 1e3)
    }
}

fn error(value: f64) -> String {
    if value >= 1.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.3}")
    }
}

fn size(bytes: u64) -> String {
    #[allow(clippy::cast_precision_loss)] // for people
    let bytes = bytes as f64;
    if bytes >= 1e6 {
        format!("{:.1} MB", bytes / 1e6)
    } else {
        format!("{:.0} kB", bytes / 1e3)
    }
}
