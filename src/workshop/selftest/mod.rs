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
use crate::paint::{CarPaint, EnergyCertificate, PaintFile, Reflectance};

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

/// The larger of two numbers, and no number where either is none: so that nothing wrong is ever passed over.
fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        f64::NAN
    } else {
        a.max(b)
    }
}

/// What the checks work on.
struct Subject<'a> {
    paint: &'a CarPaint,
    /// What the paint's file says of its energy.
    energy: &'a EnergyCertificate,
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
        energy: &file.energy,
        partner: &partner.paint,
        reflectance: Reflectance::new(&file.paint),
    };
    let parts: [fn(&Subject<'_>) -> Vec<Check>; 10] = [
        light::reflectance,
        light::energy,
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
        progress(f32::from(done) / 10.0);
    }
    Ok(checks)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paint::{AngleGrid, Coat, ColorTable, FlakeTexture, Flakes};

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

    fn failed(change: impl FnOnce(&mut CarPaint)) -> Vec<String> {
        let checks = checks_of(change).into_iter().filter(|c| !c.passed);
        checks.map(|c| c.case).collect()
    }

    /// Three clusters of other colors at each of two angle pairs.
    fn flakes() -> Flakes {
        let corner = |k: u8| [20.0 * f32::from(k % 3), f32::from(k), -3.0];
        Flakes {
            theta_h: AngleGrid::new(vec![0.0, 20.0]).expect("ascending"),
            theta_d: AngleGrid::single(),
            offsets: vec![0, 3, 6].into(),
            probability: vec![0.25, 0.5, 0.25, 0.5, 0.25, 0.25].into(),
            lower: (0..6).map(corner).collect(),
            upper: (0..6).map(|k| corner(k).map(|v| v + 4.0)).collect(),
            texture: FlakeTexture {
                texel_um: 20.0,
                grain_um: 30.0,
                lifetime_deg: [5.0; 2],
                persistence_deg: [9.0; 2],
            },
        }
    }

    #[test]
    fn each_fault_turns_its_own_row_red() {
        // Flakes that came after the certificate was made: dim ones do not show in it.
        let spoiled = |change: fn(&mut Flakes)| {
            failed(|paint| {
                let mut flakes = flakes();
                change(&mut flakes);
                paint.flakes = Some(flakes);
            })
        };
        let told = |failed: &[String], case: &str| failed.iter().any(|c| c.contains(case));
        assert!(!told(&spoiled(|_| ()), "probabilities"));
        let lost = spoiled(|flakes| flakes.probability[1] -= 1e-9);
        assert!(told(&lost, "probabilities of a slice"), "{lost:?}");
        let nan = spoiled(|flakes| flakes.lower[4][1] = f32::NAN);
        for case in ["Lab to light", "reflectance up to", "jump of a flake"] {
            assert!(told(&nan, case), "{case} of {nan:?}");
        }
        let brighter = failed(|paint| paint.diffuse = paint.diffuse.map(|v| 0.9 * v));
        assert_eq!(brighter, ["albedo against the paint's energy certificate"]);
    }

    type Change = fn(&mut CarPaint);

    /// The same table with its first node, or its one color for all, a little lighter.
    fn shifted(table: &ColorTable, node: f64, overall: f64) -> ColorTable {
        let (h, d) = (table.theta_h().clone(), table.theta_d().clone());
        let (mut nodes, mut all) = (table.nodes().to_vec(), table.overall());
        nodes[0].l += node;
        all.l += overall;
        ColorTable::new(h, d, nodes, all).expect("finite")
    }

    #[test]
    fn a_parameter_that_a_blend_would_lose_is_counted() {
        let own = CarPaint {
            flakes: Some(flakes()),
            ..sample_by_name("white")
                .expect("a sample")
                .build(&Profile::draft(), &|_| ())
                .expect("a paint")
                .paint
        };
        assert_eq!(mixing::differences(&own, &own), 0);
        let changes: [Change; 8] = [
            |p| p.coat = Some(Coat::smooth(1.7)),
            |p| p.diffuse[2] *= 1.0 + f64::EPSILON,
            |p| p.lobes[0].f0 *= 0.5,
            |p| p.color_table = shifted(&p.color_table, 1e-9, 0.0),
            |p| p.color_table = shifted(&p.color_table, 0.0, 1e-9),
            |p| p.flakes.as_mut().expect("has").lower[5][0] += 1e-4,
            |p| p.flakes.as_mut().expect("has").probability[0] += 1e-9,
            |p| p.flakes.as_mut().expect("has").texture.grain_um += 1.0,
        ];
        for (k, change) in changes.into_iter().enumerate() {
            let mut end = own.clone();
            change(&mut end);
            assert!(mixing::differences(&end, &own) > 0, "change {k}");
        }
        let bare = CarPaint {
            flakes: None,
            ..own.clone()
        };
        assert_eq!(mixing::differences(&bare, &own), 2);
    }

    #[test]
    fn a_number_that_is_none_is_no_pass() {
        assert!(!Check::at_most("x", f64::NAN, 1.0, "").passed);
        assert!(Check::none("x", 0, "").passed && !Check::none("x", 1, "").passed);
    }
}
