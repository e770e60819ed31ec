//! The quick part of the stability suite, on the machine and with the paint of whoever asks.
//!
//! Every check gives one number, how bad the worst case was, and the limit that an argument puts on it: a count of
//! roundings, a promise of a solver, or 0 for what must agree to the last bit. The paint is mixed with a sample, so that
//! transport, blend and realisation have something to do. The full suite is `cargo test --test stability`.

mod light;
mod mixing;

use serde::Serialize;

use super::{WorkshopError, sample_by_name};
use crate::accuracy::Profile;
use crate::paint::{CarPaint, PaintFile, Reflectance};

/// One case: what was found, and what it may be at most.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// What was tried.
    pub case: String,
    /// The worst that was found.
    pub found: f64,
    /// The most that is accepted.
    pub limit: f64,
    /// What the two numbers count.
    pub unit: &'static str,
    /// Whether the case holds.
    pub passed: bool,
}

impl Check {
    /// A number that is none never passes.
    fn at_most(case: impl Into<String>, found: f64, limit: f64, unit: &'static str) -> Self {
        Self {
            case: case.into(),
            found,
            limit,
            unit,
            passed: found <= limit,
        }
    }

    /// Things of which there must be none.
    fn none(case: impl Into<String>, found: usize, unit: &'static str) -> Self {
        #[allow(clippy::cast_precision_loss)] // some thousands
        Self::at_most(case, found as f64, 0.0, unit)
    }
}

/// What the checks work on.
struct Subject<'a> {
    paint: &'a CarPaint,
    /// A sample that is not the paint.
    partner: &'a CarPaint,
    reflectance: Reflectance<'a>,
}

/// Runs all checks on a paint, each a fraction of a second. `progress` hears the share done.
///
/// # Errors
///
/// [`WorkshopError`] when the sample that the paint is mixed with cannot be made. A check that fails is no error.
pub fn selftest(
    file: &PaintFile,
    profile: &Profile,
    progress: &(dyn Fn(f32) + Sync),
) -> Result<Vec<Check>, WorkshopError> {
    let partner = if file.name == "ford_f8" {
        "polaris_silber"
    } else {
        "ford_f8"
    };
    let sample = sample_by_name(partner)
        .ok_or_else(|| WorkshopError::internal(format!("the sample {partner} is gone")))?;
    let partner = sample.build(profile, &|_| ())?;
    let subject = Subject {
        paint: &file.paint,
        partner: &partner.paint,
        reflectance: Reflectance::new(&file.paint),
    };
    let parts: [fn(&Subject<'_>) -> Vec<Check>; 9] = [
        light::reflectance,
        light::color,
        light::probabilities,
        light::texels,
        mixing::transport,
        mixing::ends,
        mixing::steps,
        mixing::far_weights,
        mixing::machine,
    ];
    let mut checks = Vec::new();
    for (done, part) in (1_u8..).zip(parts) {
        checks.extend(part(&subject));
        progress(f32::from(done) / 9.0);
    }
    Ok(checks)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checks_of(change: impl FnOnce(&mut CarPaint)) -> Vec<Check> {
        let profile = Profile::draft();
        let sample = sample_by_name("white").expect("a sample");
        let mut file = sample.build(&profile, &|_| ()).expect("a paint");
        change(&mut file.paint);
        selftest(&file, &profile, &|_| ()).expect("runs")
    }

    #[test]
    fn a_sound_paint_passes_every_check() {
        for check in checks_of(|_| ()) {
            assert!(check.passed, "{check:?}");
        }
    }

    #[test]
    fn a_paint_that_is_no_number_fails_and_is_no_panic() {
        let checks = checks_of(|paint| paint.diffuse[1] = f64::NAN);
        let failed: Vec<_> = checks
            .iter()
            .filter(|c| !c.passed)
            .map(|c| c.case.as_str())
            .collect();
        assert!(
            failed.iter().any(|case| case.starts_with("reflectance")),
            "{failed:?}"
        );
    }

    #[test]
    fn a_number_that_is_none_is_no_pass() {
        assert!(!Check::at_most("x", f64::NAN, 1.0, "").passed);
        assert!(Check::none("x", 0, "").passed && !Check::none("x", 1, "").passed);
    }
}
