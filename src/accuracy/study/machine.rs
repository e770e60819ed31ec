//! What a machine takes for steps that depend on it alone.

use serde::{Deserialize, Serialize};

/// Evaluations of a paint that fitting a reflectance table takes as long as, where a coat is searched for.
const EVALUATIONS_OF_A_SEARCH: f64 = 6.0e6;

/// The same where the coat is known.
const EVALUATIONS_OF_A_FIT: f64 = 1.6e6;

/// Seconds of steps that depend on the machine and on sizes, not on what paints are like.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Writing a small file durably, and each byte beside; `None` where nothing could be written.
    pub write: Option<[f64; 2]>,
    /// Reading and hashing a byte of a file that the system has at hand.
    pub hash_byte: f64,
    /// Evaluating a paint at a pair of directions.
    pub evaluation: f64,
}

impl Machine {
    /// Whether every figure is a time.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let written = self.write.iter().flatten();
        [self.hash_byte, self.evaluation]
            .iter()
            .chain(written)
            .all(|time| time.is_finite() && *time >= 0.0)
    }

    /// Writing a file of this size durably, where that is known.
    #[must_use]
    pub fn write_seconds(&self, bytes: f64) -> Option<f64> {
        self.write.map(|[fixed, each]| fixed + each * bytes)
    }

    /// Reading and hashing a file of this size.
    #[must_use]
    pub fn hash_seconds(&self, bytes: f64) -> f64 {
        self.hash_byte * bytes
    }

    /// Fitting a reflectance table whose coat is known, or is to be found too.
    #[must_use]
    pub fn fit_seconds(&self, coat_is_known: bool) -> f64 {
        let evaluations = if coat_is_known {
            EVALUATIONS_OF_A_FIT
        } else {
            EVALUATIONS_OF_A_SEARCH
        };
        self.evaluation * evaluations
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOUND: Machine = Machine {
        write: Some([0.01, 1e-9]),
        hash_byte: 1e-10,
        evaluation: 1e-7,
    };

    #[test]
    fn every_figure_has_to_be_a_time() {
        assert!(SOUND.is_sound());
        assert!(
            Machine {
                write: None,
                ..SOUND
            }
            .is_sound()
        );
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            for machine in [
                Machine {
                    write: Some([bad, 0.0]),
                    ..SOUND
                },
                Machine {
                    write: Some([0.0, bad]),
                    ..SOUND
                },
                Machine {
                    hash_byte: bad,
                    ..SOUND
                },
                Machine {
                    evaluation: bad,
                    ..SOUND
                },
            ] {
                assert!(!machine.is_sound(), "{machine:?}");
            }
        }
    }

    #[test]
    fn seconds_follow_sizes() {
        assert_eq!(SOUND.write_seconds(1e9), Some(1.01));
        assert_eq!(SOUND.hash_seconds(1e10), 1.0);
        assert!((SOUND.fit_seconds(false) - 0.6).abs() < 1e-12);
        assert!((SOUND.fit_seconds(true) - 0.16).abs() < 1e-12);
        let unknown = Machine {
            write: None,
            ..SOUND
        };
        assert_eq!(unknown.write_seconds(1.0), None);
    }
}
