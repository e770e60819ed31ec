//! Error against time of one kind of work, its Pareto front, and the knee of that.

use serde::{Deserialize, Serialize};

use crate::accuracy::{PRESETS, Profile};

/// One profile, measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// What distinguishes it, for people.
    pub label: String,
    /// The knob that was turned, `together` for several.
    pub knob: String,
    /// All knobs.
    pub knobs: Profile,
    /// Seconds, of the study's clock.
    pub seconds: f64,
    /// Error, in the front's unit.
    pub error: f64,
    /// Size of the result, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bytes: Option<u64>,
    /// What else was measured, by name.
    #[serde(default, skip_serializing_if = "std::collections::BTreeMap::is_empty")]
    pub more: std::collections::BTreeMap<String, f64>,
    /// Whether nothing measured is both faster and more accurate.
    pub on_front: bool,
}

/// Error against time of one kind of work.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Front {
    /// `ingest`, `blend`, `join`, `realise` or `preview`.
    pub work: String,
    /// What the work is, for people.
    pub about: String,
    /// What the error is.
    pub error_is: String,
    /// Unit of the error.
    pub unit: String,
    /// Everything that was measured, by time.
    pub points: Vec<Point>,
    /// Label of the knee.
    pub knee: String,
}

impl Front {
    /// Orders points by time, finds the front and its knee.
    #[must_use]
    pub fn new(
        work: &str,
        about: &str,
        error_is: &str,
        unit: &str,
        mut points: Vec<Point>,
    ) -> Self {
        points.sort_by(|x, y| {
            x.seconds
                .total_cmp(&y.seconds)
                .then(x.error.total_cmp(&y.error))
        });
        let mut least = f64::INFINITY;
        for point in &mut points {
            // Two hundredths less is no more accurate than what is measured twice.
            point.on_front = point.error < least * 0.98;
            if point.on_front {
                least = point.error;
            }
        }
        let on_front: Vec<(f64, f64)> = points
            .iter()
            .filter(|p| p.on_front)
            .map(|p| (p.seconds, p.error))
            .collect();
        let knee = knee(&on_front).and_then(|k| points.iter().filter(|p| p.on_front).nth(k));
        Self {
            work: work.to_owned(),
            about: about.to_owned(),
            error_is: error_is.to_owned(),
            unit: unit.to_owned(),
            knee: knee.map_or_else(String::new, |p| p.label.clone()),
            points,
        }
    }

    /// The preset's own point: the one with its very settings, as far as this work looks at them.
    #[must_use]
    pub fn preset(&self, name: &str) -> Option<&Point> {
        self.points.iter().find(|p| p.label == name)
    }

    /// Presets that were measured, the cheapest first.
    pub fn presets(&self) -> impl Iterator<Item = (&'static str, &Point)> {
        PRESETS
            .iter()
            .filter_map(|&name| Some((name, self.preset(name)?)))
    }

    /// What beats a point: takes at most nine tenths of its time for no more error, or as much time for at most nine
    /// tenths of its error. Of several the most accurate.
    #[must_use]
    pub fn beaten_by(&self, point: &Point) -> Option<&Point> {
        let beats = |other: &&Point| {
            let (time, error) = (other.seconds, other.error);
            (time <= 0.9 * point.seconds && error <= point.error)
                || (time <= point.seconds && error <= 0.9 * point.error)
        };
        let beating = self.points.iter().filter(beats);
        beating.min_by(|x, y| x.error.total_cmp(&y.error))
    }
}

/// The point of a falling curve that is farthest below the line between its ends: from there on a share of the whole time
/// buys less than that share of the whole error.
///
/// Both axes are linear, as in V. Satopää, J. Albrecht, D. Irwin, B. Raghavan, "Finding a 'kneedle' in a haystack", 2011:
/// errors are in units of what is seen, so that 0.1 less is worth as much from 2 as from 0.2. The ends of the front decide
/// what the whole is: a coarser or finer setting at one of them moves the knee.
fn knee(front: &[(f64, f64)]) -> Option<usize> {
    let (first, last) = (front.first()?, front.last()?);
    let (&(t0, e0), &(t1, e1)) = (first, last);
    if t1 <= t0 || e1 >= e0 {
        return Some(0);
    }
    let below = |&(t, e): &(f64, f64)| (t1 - t) / (t1 - t0) - (e - e1) / (e0 - e1);
    (0..front.len()).max_by(|&x, &y| below(&front[x]).total_cmp(&below(&front[y])))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(label: &str, seconds: f64, error: f64) -> Point {
        Point {
            label: label.to_owned(),
            knob: "clusters".to_owned(),
            knobs: Profile::standard(),
            seconds,
            error,
            bytes: None,
            more: std::collections::BTreeMap::new(),
            on_front: false,
        }
    }

    #[test]
    fn nothing_on_the_front_is_beaten_in_both() {
        let points = vec![
            point("slow", 10.0, 0.1),
            point("beaten", 5.0, 0.9),
            point("fast", 1.0, 1.0),
            point("good", 2.0, 0.2),
        ];
        let front = Front::new("blend", "", "", "Lab", points);
        let on: Vec<&str> = front
            .points
            .iter()
            .filter(|p| p.on_front)
            .map(|p| p.label.as_str())
            .collect();
        assert_eq!(on, ["fast", "good", "slow"]);
        assert_eq!(front.knee, "good");
        let beaten = &front.points[2];
        let by = front.beaten_by(beaten).map(|point| point.label.as_str());
        assert_eq!((beaten.label.as_str(), by), ("beaten", Some("good")));
        // On logarithmic axes it would be the third.
        let steep = [
            ("a", 1.0, 10.0),
            ("b", 10.0, 1.0),
            ("c", 30.0, 0.11),
            ("d", 100.0, 0.1),
        ];
        let steep = steep.map(|(label, seconds, error)| point(label, seconds, error));
        assert_eq!(Front::new("blend", "", "", "Lab", steep.to_vec()).knee, "b");
        assert!(on.iter().all(|label| {
            let point = front.points.iter().find(|p| p.label == **label);
            point.is_some_and(|point| front.beaten_by(point).is_none())
        }));
    }
}
