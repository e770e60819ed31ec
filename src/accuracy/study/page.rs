//! The study as a page for people, Markdown.

use std::fmt::Write as _;

use super::{Front, Study};

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
        "Measured with carpaint {} on {} threads, with {}. Times are {}, the shortest of several goes. The same for your machine and your paints: \
         `carpaint study --out DIR PAINT...`. Put its `study.json` into the service's data folder, and `GET /v1/accuracy` \
         serves it.\n\n",
        study.program,
        study.threads,
        list(&study.paints),
        study.clock
    );
    at_a_glance(&mut page, study);
    for front in &study.fronts {
        section(&mut page, front);
    }
    growth(&mut page, study);
    page.push_str(
        "## How to read the errors\n\n\
         - **Lab** is a distance between colors as people see them; 1 is about what a trained eye tells apart side by side. \
         Flakes are distributions of color, and the distance of two distributions (W1) is how far the average texel's color \
         would have to move to turn one into the other. What each step misplaces is added up: pixels to clusters, \
         detours between paints, rounding in the file.\n\
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

/// How the default was chosen, as far as this study bears it out.
fn choice(study: &Study) -> String {
    let near = |front: &&Front| {
        front
            .preset("standard")
            .is_some_and(|p| p.on_front || front.above_front(p) < 1.1)
    };
    let (near, all) = (study.fronts.iter().filter(near).count(), study.fronts.len());
    let seen = study
        .fronts
        .iter()
        .filter_map(|front| front.preset("standard"))
        .map(|p| p.error)
        .fold(0.0, f64::max);
    format!(
        "The presets were chosen from these fronts. `standard` stands on or within a tenth of {near} of {all} of them, next \
         to their knees; its errors, {} at most, stay below the 1 that a trained eye tells apart, with room for several \
         paints to add up. `draft` gives up what is seen only in a close look for the time that is left then; `reference` is \
         where more clusters and samples hardly change anything.\n\n",
        error(seen)
    )
}

fn section(page: &mut String, front: &Front) {
    let _ = write!(
        page,
        "## {}\n\n![Error against time]({}.svg)\n\n{}\n\n",
        front.about, front.work, front.error_is
    );
    page.push_str(&verdict(front));
    page.push_str("\n| setting | time | error | size |\n|---|---:|---:|---:|\n");
    for point in front
        .points
        .iter()
        .filter(|p| p.on_front || is_preset(p.label.as_str()))
    {
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
        let size = point.bytes.map_or_else(String::new, size);
        let _ = writeln!(
            page,
            "| {mark} | {} | {error} | {size} |",
            time(point.seconds)
        );
    }
    page.push('\n');
}

fn is_preset(label: &str) -> bool {
    crate::accuracy::PRESETS.contains(&label)
}

/// Where the presets stand, and whether `standard` is the knee.
fn verdict(front: &Front) -> String {
    let mut said = String::new();
    for (name, point) in front.presets() {
        let above = front.above_front(point);
        let stands = if point.on_front {
            "stands on the front".to_owned()
        } else if above < 1.1 {
            "stands within a tenth of the front".to_owned()
        } else {
            format!("stands above the front: as fast, {above:.1} times less error can be had")
        };
        let _ = writeln!(said, "- `{name}` {stands}.");
    }
    if front.knee == "standard" {
        said.push_str(
            "- The knee of this front is `standard` itself: beyond it, time grows faster than the error falls. \
             That is why it is the default.\n",
        );
    } else if !front.knee.is_empty() {
        let _ = writeln!(
            said,
            "- The knee of this front, from which on time grows faster than the error falls, is {}.",
            if is_preset(&front.knee) {
                format!("`{}`", front.knee)
            } else {
                format!("at {}", front.knee)
            }
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
        "## How time grows\n\n![Time against size](growth.svg)\n\n| with | what is done | from | to | time grows as | \
         should be at most |\n|---|---|---:|---:|---|---|\n",
    );
    for growth in &study.growth {
        let end = |p: Option<&[f64; 2]>| {
            p.map_or_else(String::new, |[size, seconds]| {
                format!("{size:.0}: {}", time(*seconds))
            })
        };
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | size^{:.2} | size^{:.1}{} |",
            growth.with,
            growth.about,
            end(growth.points.first()),
            end(growth.points.last()),
            growth.exponent,
            growth.limit,
            if growth.is_within() { "" } else { " (missed)" }
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
